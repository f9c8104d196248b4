"""Write PRISM's explicit files: .tra .sta .lab .srew .trew.

Source: the appendix 'Explicit Model Files' of the PRISM manual, version 4.8 and later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from symcheck.exchange.explicit_data import ExplicitRewards
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.text import CHUNK, FULL_PRECISION, lines, number_texts
from symcheck.matrices.numbers import Numbers, nonzero
from symcheck.matrices.rows import Int32s, Int64s
from symcheck.semantics.state_faults import SUM_TOLERANCE

__all__ = [
    "labels_file",
    "state_rewards_file",
    "states_file",
    "transition_rewards_file",
    "transitions_file",
]


def states_file(model: ExplicitExport) -> Iterator[str]:
    """`.sta`: the names of the variables, then the states, as `0:(1,true)`."""
    yield f"({','.join(v.name for v in model.variables)})\n"
    yield from lines("%d:%s", model.n, np.arange(model.n), model.state_texts)


def transitions_file(
    model: ExplicitExport,
    *,
    precision: int = FULL_PRECISION,
    rows: bool = False,
    headers: bool | None = None,
) -> Iterator[str]:
    """`.tra`: the size of the model, then one line per transition.

    Lines of an MDP hold the number of the choice too. A transition of a chain to which several
    actions contribute has one line per action, with the part of this action.

    Args:
        model: the exported model.
        precision: significant digits.
        rows: write one line per row of the matrix instead of one per transition; the rows of a
            chain have no action.
        headers: write a comment with the model type; None: where a reader could not infer it.
    """
    m = model.matrix
    ambiguous = model.type.continuous_time and bool(
        np.all(np.abs(model.row_sums - 1) <= SUM_TOLERANCE)
    )  # without a comment, a reader infers a DTMC
    if headers or (headers is None and ambiguous):
        yield f"# Transitions ({model.type.name})\n"
    if rows:
        yield f"{_size(model)} {m.entries}\n"
        yield from _row_lines(
            model, model.values, np.ones(m.entries, bool), precision, actions=True
        )
        return
    parts = model.parts
    yield f"{_size(model)} {len(parts.entry)}\n"
    columns = (*_places(model, parts.entry), parts.values)
    template = "%d " * (len(columns) - 1) + "%s"
    if (parts.action < 0).all():
        yield from lines(template, len(parts.entry), *columns, precision=precision)
        return
    actions = [f" {name}" if name else "" for name in parts.texts(model.actions)]
    yield from lines(template + "%s", len(parts.entry), *columns, actions, precision=precision)


def labels_file(model: ExplicitExport, names: Sequence[str] | None = None) -> Iterator[str]:
    """`.lab`: the numbers of the labels (all, or those in `names`), then the labelled states."""
    names = list(model.labels) if names is None else names
    yield " ".join(f'{i}="{name}"' for i, name in enumerate(names)) + "\n"
    table = np.array([model.labels[name] for name in names]).reshape(len(names), model.n)
    having = np.flatnonzero(table.any(axis=0))

    def numbers(start: int, stop: int) -> list[str]:
        return [
            " ".join(map(str, np.flatnonzero(column).tolist()))
            for column in table[:, having[start:stop]].T
        ]

    yield from lines("%d: %s", len(having), having, numbers)


def state_rewards_file(
    model: ExplicitExport,
    structure: ExplicitRewards,
    *,
    precision: int = FULL_PRECISION,
    headers: bool = True,
) -> Iterator[str]:
    """`.srew`: the numbers of states and of nonzero rewards, then one line per nonzero reward."""
    some = np.flatnonzero(nonzero(structure.states))
    yield _heading(structure, "State rewards") if headers else ""
    yield f"{model.n} {len(some)}\n"
    yield from lines("%d %s", len(some), some, structure.states[some], precision=precision)


def transition_rewards_file(
    model: ExplicitExport,
    number: int,
    *,
    precision: int = FULL_PRECISION,
    headers: bool = True,
    rows: bool = False,
) -> Iterator[str]:
    """`.trew`: like `.tra`, for the transitions with a nonzero reward in structure `number`."""
    rewards = model.entry_rewards(number)
    has_reward = nonzero(rewards)
    some = np.flatnonzero(has_reward)
    yield _heading(model.rewards[number], "Transition rewards") if headers else ""
    yield f"{_size(model)} {len(some)}\n"
    if rows:
        yield from _row_lines(model, rewards, has_reward, precision, actions=False)
        return
    digits = _places(model, some)
    template = "%d " * len(digits) + "%s"
    yield from lines(template, len(some), *digits, rewards[some], precision=precision)


def _places(model: ExplicitExport, entries: Int64s) -> tuple[Int64s | Int32s, ...]:
    """The source, the choice (of an MDP) and the target of each entry."""
    rows, targets = model.row_of_entry[entries], model.matrix.indices[entries]
    choice = () if model.matrix.groups is None else (model.choice_of_row[rows],)
    return model.state_of_row[rows], *choice, targets


def _size(model: ExplicitExport) -> str:
    return f"{model.n}" if model.matrix.groups is None else f"{model.n} {model.matrix.rows}"


def _heading(structure: ExplicitRewards, what: str) -> str:
    name = f' "{structure.name}"' if structure.name else ""
    return f"# Reward structure{name}\n# {what}\n"


def _row_lines(
    model: ExplicitExport,
    values: Numbers,
    some: NDArray[np.bool_],
    precision: int,
    actions: bool,
) -> Iterator[str]:
    """One line per row: its state, and `value:target` of the entries in `some`."""
    m = model.matrix
    names = model.action_texts()
    for start in range(0, m.rows, CHUNK):
        stop = min(start + CHUNK, m.rows)
        first = int(m.indptr[start])
        chosen = first + np.flatnonzero(some[first : int(m.indptr[stop])])
        texts = [
            f"{v}:{t}"
            for v, t in zip(
                number_texts(values[chosen], precision), m.indices[chosen].tolist(), strict=True
            )
        ]
        ends: Int64s = np.searchsorted(chosen, m.indptr[start : stop + 1])
        yield "".join(
            " ".join([str(s), *texts[a:b], *([names[r]] if actions and names[r] else [])]) + "\n"
            for r, s, a, b in zip(
                range(start, stop),
                model.state_of_row[start:stop].tolist(),
                ends[:-1].tolist(),
                ends[1:].tolist(),
                strict=True,
            )
        )
