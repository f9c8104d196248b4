"""Offset-labelled decision diagrams (ODDs): a numbering of the members of a set, and arrays over
them.

An ODD is the BDD of a set that has, at each node, the number of members below it. Members are
numbered lexicographically in the order of the bits. Conversions take O(nodes + members), so that a
small subset of a huge set is cheap.

Source: Parker (2002), Implementation of symbolic model checking for probabilistic systems, section
6.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.export import BddTable, NodeTable
from symcheck.errors import UnsupportedError
from symcheck.kernels.diagrams import odd as kernel
from symcheck.kernels.diagrams import vectors

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd

__all__ = ["Odd", "OddTable"]

OddTable = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], int]
"""depth, low, high, count (arrays per node) and the root (see `symcheck.kernels.diagrams.odd`)."""

_TRUTH = np.array([0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Odd:
    """The numbers 0 to count - 1 for the members of a set.

    It stays valid when the manager's variables are reordered, as long as `rows` keep their relative
    order.

    Args:
        manager: the manager of the set.
        states: the set.
        rows: its variables (bits), from the top of the diagrams down.

    Raises:
        UnsupportedError: on first use, for 2**63 members or more.
        ValueError: on first use, if the set depends on other variables.
    """

    manager: DiagramManager = field(repr=False)
    states: Bdd = field(repr=False)
    rows: tuple[str, ...] = field(repr=False)

    def __init__(self, manager: DiagramManager, states: Bdd, rows: Sequence[str]) -> None:
        object.__setattr__(self, "manager", manager)
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "rows", tuple(rows))

    @cached_property
    def table(self) -> OddTable:
        """The diagram as arrays."""
        t = self.manager.export_bdd(self.states)
        try:
            return kernel.build((t.level, t.low, t.high, _TRUTH, t.root), self.levels)
        except OverflowError as error:
            raise UnsupportedError(f"{error}, which cannot be numbered") from error

    @property
    def levels(self) -> NDArray[np.int32]:
        """The current levels of the bits, int32[k]. Raises ValueError where their relative order
        has changed.
        """
        return levels_of(self.manager, self.rows)

    @property
    def count(self) -> int:
        """Number of members."""
        return int(self.table[3][self.table[4]])

    @property
    def nodes(self) -> int:
        """Number of nodes, the two leaves included."""
        return len(self.table[0])

    def __len__(self) -> int:
        return self.count

    def __repr__(self) -> str:
        return f"Odd({self.count} members over {len(self.rows)} bits, {self.nodes} nodes)"

    # Numbers and bits

    def unrank(self, indices: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Bits of the members with these numbers: uint8[m, k]. Raises IndexError for a number out
        of range.
        """
        bits = np.empty((len(indices), len(self.rows)), np.uint8)
        kernel.unrank(self.table, np.ascontiguousarray(indices, np.int64), bits)
        return bits

    def rank(self, bits: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Numbers of the members with these bits (uint8[m, k]), int64[m]; -1 for a non-member."""
        out = np.empty(len(bits), np.int64)
        kernel.rank(
            self.table,
            np.ascontiguousarray(bits, np.uint8).reshape(len(bits), len(self.rows)),
            out,
        )
        return out

    def indices_in(self, other: Odd) -> NDArray[np.int64]:
        """The number of each member in `other`, the ODD of a superset over the same bits:
        int64[count].

        Raises ValueError if `other` is no superset.
        """
        if not self.states <= other.states or self.rows != other.rows:
            raise ValueError("the other set is not a superset over the same bits")
        return np.flatnonzero(other.to_mask(self.states))

    # Diagrams and arrays

    def to_mask(self, states: Bdd) -> NDArray[np.bool_]:
        """Which members belong to another set: bool[count]."""
        t = self.manager.export_bdd(states)
        out = np.zeros(self.count, np.uint8)
        vectors.diagram_to_array(
            self.table, (t.level, t.low, t.high, _TRUTH, t.root), self.levels, out
        )
        return out.view(np.bool_)

    def from_mask(self, members: NDArray[np.bool_]) -> Bdd:
        """The set of the members where the mask (bool[count]) is true."""
        if len(members) != self.count:
            raise ValueError(f"{len(members)} truth values for {self.count} members")
        levels, bottom = self.levels, self.manager.size
        level, low, high, root = vectors.array_to_diagram(
            self.table, np.ascontiguousarray(members).view(np.uint8), 2, levels, bottom
        )
        return self.manager.import_bdd(
            BddTable(bottom, level, low, high, np.array([root], np.int32))
        )[0]

    def to_vector(self, function: Mtbdd) -> NDArray[np.float64]:
        """Values of a function at the members: float64[count]."""
        t = self.manager.export_mtbdd(function)
        out = np.zeros(self.count)
        vectors.diagram_to_array(
            self.table, (t.level, t.low, t.high, t.values, t.root), self.levels, out
        )
        return out

    def from_vector(self, values: NDArray[np.float64]) -> Mtbdd:
        """The function with these values (float64[count]) at the members, and 0 elsewhere. -0.0
        becomes 0.
        """
        if len(values) != self.count:
            raise ValueError(f"{len(values)} values for {self.count} members")
        ids = np.empty(len(values), np.int32)
        leaves = vectors.number_values(np.ascontiguousarray(values, np.float64), ids)
        levels, bottom = self.levels, self.manager.size
        level, low, high, root = vectors.array_to_diagram(
            self.table, ids, len(leaves), levels, bottom
        )
        return self.manager.import_mtbdd(
            NodeTable(bottom, level, low, high, leaves, np.array([root], np.int32))
        )[0]


def levels_of(manager: DiagramManager, names: Sequence[str]) -> NDArray[np.int32]:
    """Levels of variables, int32[k]. Raises ValueError where they are not in top-down order."""
    levels = np.array([manager.level_of(name) for name in names], np.int32)
    if (np.diff(levels) <= 0).any():
        raise ValueError(
            "the bits are not in the order of the diagrams (was the manager reordered?)"
        )
    return levels
