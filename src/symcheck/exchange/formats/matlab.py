"""A chain as a Matlab or Octave script: sparse matrices and vectors, numbered from 1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.text import FULL_PRECISION, lines
from symcheck.matrices.numbers import Numbers, nonzero
from symcheck.matrices.rows import Int64s

__all__ = ["labels", "state_rewards", "states", "transition_rewards", "transitions"]


def transitions(model: ExplicitExport, *, precision: int = FULL_PRECISION) -> Iterator[str]:
    """The transition matrix `P` (rates of a CTMC: `R`). Raises UnsupportedError for an MDP."""
    name = "R" if model.type.continuous_time else "P"
    yield from _matrix(model, name, np.arange(model.matrix.entries), model.values, precision)


def transition_rewards(
    model: ExplicitExport, number: int, *, precision: int = FULL_PRECISION
) -> Iterator[str]:
    """The transition rewards as the matrix `C1` (`C2`, … for further structures).

    Raises UnsupportedError for an MDP.
    """
    rewards = model.entry_rewards(number)
    yield from _matrix(
        model, f"C{number + 1}", np.flatnonzero(nonzero(rewards)), rewards, precision
    )


def state_rewards(
    model: ExplicitExport, number: int, *, precision: int = FULL_PRECISION
) -> Iterator[str]:
    """The state rewards as the column vector `c1` (`c2`, … for further structures)."""
    name, values = f"c{number + 1}", model.rewards[number].states
    some = np.flatnonzero(nonzero(values))
    yield f"{name} = sparse({model.n},1);\n"
    yield from lines(f"{name}(%d)=%s;", len(some), some + 1, values[some], precision=precision)


def states(model: ExplicitExport) -> Iterator[str]:
    """The matrix `states`: a row per state, a column per variable (true is 1)."""
    yield f"% ({','.join(v.name for v in model.variables)})\nstates=[\n"
    yield from lines(
        "%s",
        model.n,
        lambda a, b: [
            ",".join(map(str, row))
            for row in zip(*(c[a:b].tolist() for c in model.columns), strict=True)
        ],
    )
    yield "];\n"


def labels(model: ExplicitExport, names: Sequence[str]) -> Iterator[str]:
    """A column `l_NAME` for each label, 1 where it holds."""
    columns = [
        "l_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in name) for name in names
    ]
    yield "".join(f"{column}=sparse({model.n},1);\n" for column in columns) + "\n"
    for name, column in zip(names, columns, strict=True):
        members = np.flatnonzero(model.labels[name])
        yield from lines(f"{column}(%d)=1;", len(members), members + 1)


def _matrix(
    model: ExplicitExport,
    name: str,
    chosen: Int64s,
    values: Numbers,
    precision: int,
) -> Iterator[str]:
    """The chosen entries of a matrix."""
    if model.matrix.groups is not None:
        raise UnsupportedError(
            "the Matlab format has one matrix, and an MDP has several choices per state",
            hint="the formats .tra, .drn and .umb hold MDPs",
        )
    yield f"{name} = sparse({model.n},{model.n});\n"
    row, column = model.row_of_entry[chosen] + 1, model.matrix.indices[chosen] + 1
    yield from lines(
        f"{name}(%d,%d)=%s;", len(chosen), row, column, values[chosen], precision=precision
    )
