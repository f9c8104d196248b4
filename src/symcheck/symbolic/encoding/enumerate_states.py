"""The valuations of the states of a set."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from symcheck.symbolic.encoding.variables import Encoding

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["enumerate_states"]


def enumerate_states(
    manager: DiagramManager, encoding: Encoding, states: Bdd
) -> Iterator[tuple[bool | int, ...]]:
    """The values of the variables in each state of a set over row bits, in diagram order.

    Each state costs a difference of diagrams: take few of a large set, which needs no numbers and
    may have any size.
    """
    while (row := manager.pick(states, encoding.rows)) is not None:
        yield from encoding.valuations(row[None])
        states = states - manager.bdd_from_rows(encoding.rows, row[None])
