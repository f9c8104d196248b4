"""Orders of the variables, which decide how large diagrams become: given by name, or found by FORCE (by sifting: `sift.py`).

FORCE (Aloul, Markov & Sakallah 2003) moves each variable to the mean of the centres of what it occurs in, here the events,
and repeats that while the spans (how far an event's variables are apart in the order) get smaller.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import UsageError
from symcheck.semantics.model import BoundModel, Event
from symcheck.symbolic.encoding.expressions import support

__all__ = ["FORCE", "SIFT", "check_order", "force", "is_sifted", "spans", "variable_order"]

FORCE = "force"
"""The name that asks for an order found by FORCE, unless a variable is called so."""

SIFT = "sift"
"""The name that asks for an order found by sifting, unless a variable is called so."""

_ROUNDS = 100


def is_sifted(model: BoundModel, asked: Sequence[str] | None) -> bool:
    """Whether `asked` stands for an order that sifting is to find."""
    return (
        asked is not None and list(asked) == [SIFT] and all(v.name != SIFT for v in model.variables)
    )


def variable_order(model: BoundModel, asked: Sequence[str] | None) -> tuple[str, ...] | None:
    """The names from the top of the diagrams down that `asked` stands for; None is declaration order.

    Raises UsageError for a name that no variable has.
    """
    if asked is None:
        return None
    names = [v.name for v in model.variables]
    if list(asked) == [FORCE] and FORCE not in names:
        return tuple(names[i] for i in force(_occurrences(model), len(names)))
    check_order(model, asked)
    return tuple(asked)


def check_order(model: BoundModel, asked: Sequence[str]) -> None:
    """Raise UsageError for a name that no variable has, nor stands for an order that is looked for."""
    names = [v.name for v in model.variables]
    unknown = (
        [] if list(asked) in ([FORCE], [SIFT]) else [name for name in asked if name not in names]
    )
    if unknown:
        raise UsageError(
            f"the order names {unknown[0]}, and the model has no such variable\n  hint: it has {', '.join(names[:20])}"
        )


def force(edges: Sequence[NDArray[np.int64]], count: int) -> list[int]:
    """An order of `count` things that brings those close that share an edge; never worse in spans than 0, 1, 2 …

    edges: the members of each edge. O(rounds × members).
    """
    edges = [e for e in edges if len(e) > 1]
    place = np.arange(count, dtype=np.float64)
    best, smallest = place, spans(edges, place)
    if not edges:
        return list(range(count))
    members = np.concatenate(edges)
    of = np.repeat(np.arange(len(edges)), [len(e) for e in edges])
    degree = np.bincount(members, minlength=count)
    sizes = np.bincount(of)
    for _ in range(_ROUNDS):
        centres = np.bincount(of, weights=place[members]) / sizes
        pulled = np.bincount(members, weights=centres[of], minlength=count)
        wanted = np.where(degree > 0, pulled / np.maximum(degree, 1), place)
        moved = np.empty(count)
        moved[np.argsort(wanted, kind="stable")] = np.arange(count)
        size = spans(edges, moved)
        if size < smallest:
            best, smallest = moved, size
        elif np.array_equal(moved, place):
            break
        place = moved
    return [int(i) for i in np.argsort(best)]


def spans(edges: Sequence[NDArray[np.int64]], place: NDArray[np.float64]) -> float:
    """How far the members of each edge are apart, in total."""
    edges = [e for e in edges if len(e)]
    if not edges:
        return 0.0
    starts = np.cumsum([0, *(len(e) for e in edges[:-1])])
    places = place[np.concatenate(edges)]
    return float((np.maximum.reduceat(places, starts) - np.minimum.reduceat(places, starts)).sum())


def _occurrences(model: BoundModel) -> list[NDArray[np.int64]]:
    """The variables that each event reads or assigns, each set once."""
    index = {v.name: i for i, v in enumerate(model.variables)}
    sets = {frozenset(_variables(event, index)) for event in model.events}
    return [np.array(sorted(s), dtype=np.int64) for s in sorted(sets, key=sorted) if s]


def _variables(event: Event, index: dict[str, int]) -> set[int]:
    found: set[int] = set()
    for command in (c for commands in event.participants for c in commands):
        read = support(command.guard).union(*(support(u.probability) for u in command.updates))
        for update in command.updates:
            for assigned, expression in update.assignments:
                found.add(assigned)
                read |= support(expression)
        found |= {index[name] for name in read}
    return found
