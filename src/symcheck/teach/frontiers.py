"""The reachability search, iteration by iteration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING

from symcheck.symbolic.encoding.enumerate_states import enumerate_states
from symcheck.symbolic.reachability.search import search

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd
    from symcheck.symbolic.encoding.variables import Encoding
    from symcheck.symbolic.model import Iteration, SymbolicModel

__all__ = ["SearchFrame", "frontiers"]


@dataclass(frozen=True, eq=False)
class SearchFrame:
    """The reachability search after an iteration.

    Attributes:
        iteration: counts of the iteration.
        states: the states reached so far.
        frontier: the states that this iteration found.
        found: the first of these, as values in declaration order.
        encoding: says which bits encode which variable.
    """

    iteration: Iteration
    states: Bdd = field(repr=False)
    frontier: Bdd = field(repr=False)
    found: tuple[tuple[bool | int, ...], ...]
    encoding: Encoding = field(repr=False)

    def __str__(self) -> str:
        i = self.iteration
        shown = " ".join("(" + ",".join(map(_text, s)) + ")" for s in self.found)
        more = (
            f" … {i.frontier} in all"
            if i.frontier is not None and i.frontier > len(self.found)
            else ""
        )
        return f"{i.number}: {i.states} states in {i.nodes} nodes; new: {shown or 'nothing'}{more}"


def frontiers(
    symbolic: SymbolicModel,
    schedule: str = "frontier",
    *,
    limit: int = 8,
    frames: int | None = None,
) -> Iterator[SearchFrame]:
    """A frame per iteration of the reachability search.

    Args:
        symbolic: the encoded model.
        schedule: 'frontier' (breadth first), 'chaining' or 'saturation'.
        limit: the most new states that a frame lists.
        frames: the most frames. None: no limit.

    Example:
        >>> for frame in teach.frontiers(symbolic):  # doctest: +SKIP
        ...     print(frame)
    """
    encoding = symbolic.encoding
    for found in islice(search(symbolic, schedule), frames):
        rows = enumerate_states(found.symbolic.manager, found.frontier, encoding.rows, limit)
        values = tuple(
            tuple(bool(x) if v.is_bool else x for v, x in zip(encoding.variables, row, strict=True))
            for row in encoding.codes(rows).tolist()
        )
        yield SearchFrame(found.iteration, found.states, found.frontier, values, encoding)


def _text(value: bool | int) -> str:
    return str(value).lower()
