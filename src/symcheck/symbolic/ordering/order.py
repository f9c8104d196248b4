"""Variable orders: given by name, or computed by FORCE. Sifting is in `sifting.py`.

FORCE moves each variable to the mean of the centres of gravity of the hyperedges that it belongs
to, here the events, and repeats this while the total span of the hyperedges decreases.

Source: Aloul, Markov and Sakallah (2003), FORCE: a fast and easy-to-implement variable-ordering
heuristic.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import UsageError
from symcheck.semantics.model import BoundModel, Event
from symcheck.symbolic.encoding.expressions import support
from symcheck.symbolic.tuning import FORCE_ROUNDS

__all__ = ["FORCE", "SIFT", "check_order", "force", "is_sifted", "total_span", "variable_order"]

FORCE = "force"
"""The name that stands for an order computed by FORCE, unless a variable has this name."""

SIFT = "sift"
"""The name that stands for an order computed by sifting, unless a variable has this name."""


def is_sifted(model: BoundModel, requested: Sequence[str] | None) -> bool:
    """Whether `requested` stands for an order by sifting."""
    return (
        requested is not None
        and list(requested) == [SIFT]
        and all(v.name != SIFT for v in model.variables)
    )


def variable_order(model: BoundModel, requested: Sequence[str] | None) -> tuple[str, ...] | None:
    """The requested order as names from the top of the diagrams down; None is declaration order.

    Raises UsageError for an unknown name.
    """
    if requested is None:
        return None
    names = [v.name for v in model.variables]
    if list(requested) == [FORCE] and FORCE not in names:
        return tuple(names[i] for i in force(_occurrences(model), len(names)))
    check_order(model, requested)
    return tuple(requested)


def check_order(model: BoundModel, requested: Sequence[str]) -> None:
    """Raise UsageError for a name that neither a variable has nor stands for a computed order."""
    names = [v.name for v in model.variables]
    unknown = (
        []
        if list(requested) in ([FORCE], [SIFT])
        else [name for name in requested if name not in names]
    )
    if unknown:
        raise UsageError(
            f"the order names {unknown[0]}, and the model has no such variable",
            hint=f"it has {', '.join(names[:20])}",
        )


def force(edges: Sequence[NDArray[np.int64]], count: int) -> list[int]:
    """The order of `count` vertices by FORCE; its total span is at most that of 0, 1, 2 … O(rounds
    * members).

    edges: the vertices of each hyperedge, int64 arrays.
    """
    edges = [e for e in edges if len(e) > 1]
    position = np.arange(count, dtype=np.float64)
    best, smallest = position, total_span(edges, position)
    if not edges:
        return list(range(count))
    members = np.concatenate(edges)
    of = np.repeat(np.arange(len(edges)), [len(e) for e in edges])
    degree = np.bincount(members, minlength=count)
    sizes = np.bincount(of)
    for _ in range(FORCE_ROUNDS):
        centres = np.bincount(of, weights=position[members]) / sizes
        pulled = np.bincount(members, weights=centres[of], minlength=count)
        target = np.where(degree > 0, pulled / np.maximum(degree, 1), position)
        moved = np.empty(count)
        moved[np.argsort(target, kind="stable")] = np.arange(count)
        size = total_span(edges, moved)
        if size < smallest:
            best, smallest = moved, size
        elif np.array_equal(moved, position):
            break
        position = moved
    return [int(i) for i in np.argsort(best)]


def total_span(edges: Sequence[NDArray[np.int64]], position: NDArray[np.float64]) -> float:
    """The total span of the hyperedges: the distances between their first and last vertices."""
    edges = [e for e in edges if len(e)]
    if not edges:
        return 0.0
    starts = np.cumsum([0, *(len(e) for e in edges[:-1])])
    positions = position[np.concatenate(edges)]
    return float(
        (np.maximum.reduceat(positions, starts) - np.minimum.reduceat(positions, starts)).sum()
    )


def _occurrences(model: BoundModel) -> list[NDArray[np.int64]]:
    """The sets of variables that the events read or assign, without duplicates."""
    index = {v.name: i for i, v in enumerate(model.variables)}
    sets = {frozenset(_variables(event, index)) for event in model.events}
    return [np.array(sorted(s), dtype=np.int64) for s in sorted(sets, key=sorted) if s]


def _variables(event: Event, index: dict[str, int]) -> set[int]:
    result: set[int] = set()
    for command in (c for commands in event.participants for c in commands):
        read = support(command.guard).union(*(support(u.probability) for u in command.updates))
        for update in command.updates:
            for assigned, expression in update.assignments:
                result.add(assigned)
                read |= support(expression)
        result |= {index[name] for name in read}
    return result
