"""Strongly connected components and end components of a model, as lists of states."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.matrices.rows import Int64s
from symcheck.numerics import graph

__all__ = ["KINDS", "components_file"]

KINDS = ("sccs", "bsccs", "mecs")
_TITLES = {"sccs": "SCC", "bsccs": "BSCC", "mecs": "MEC"}


def components_file(model: ExplicitExport, kind: str) -> Iterator[str]:
    """The variables, then each component: a title such as `BSCC 1/6:`, and its states as in `.sta`.

    Args:
        model: the exported model.
        kind: 'sccs' (nontrivial strongly connected components), 'bsccs' (bottom ones) or 'mecs'
            (maximal end components). Components are ordered by their first states.

    Raises:
        UnsupportedError: 'mecs' of a chain.
    """
    components = sorted(_components(model, kind), key=lambda states: int(states[0]))
    yield f"({','.join(v.name for v in model.variables)})\n"
    for i, states in enumerate(components):
        yield f"\n{_TITLES[kind]} {i + 1}/{len(components)}:\n"
        for state in states.tolist():
            yield f"{state}:{model.state_texts(state, state + 1)[0]}\n"


def _components(model: ExplicitExport, kind: str) -> list[Int64s]:
    match kind:
        case "sccs":
            return graph.nontrivial_sccs(model.matrix)
        case "bsccs":
            return [b.astype(np.int64) for b in graph.bsccs(model.matrix)]
        case "mecs":
            if model.matrix.groups is None:
                raise UnsupportedError(
                    "end components exist only in MDPs",
                    hint="-exportbsccs lists the bottom components of a chain",
                )
            return graph.grouped(
                graph.maximal_end_components(model.matrix, np.ones(model.n, np.bool_)).of
            )
        case _:
            raise AssertionError(f"no kind of components: {kind}")
