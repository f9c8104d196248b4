"""Numbers for the members of a set: which index has a state, and back; arrays over the members and diagrams, and back.

`Odd` is an offset-labelled decision diagram: the BDD of the set with, at each node, the number of members below it
(Parker 2002, section 6.3). Members are numbered lexicographically in the order of the bits. Conversions take
O(nodes + members), and a small subset of a huge set needs its own ODD only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.export import BddTable, NodeTable
from symcheck.kernels.diagrams import odd as kernel
from symcheck.kernels.diagrams import vectors

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd

__all__ = ["Odd", "Table"]

Table = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], int]
"""depth, low, high, count and the root's number (see `symcheck.kernels.diagrams.odd`)."""

_TRUTH = np.array([0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Odd:
    """Numbers 0 .. count-1 for the members of `states`, a set over the bits `rows` (from the top of the diagrams down).

    It stays valid when the manager's variables are reordered, as long as `rows` keep their order among themselves.
    Raises OverflowError on first use for 2**63 members or more, ValueError if the set depends on other variables.
    """

    manager: DiagramManager = field(repr=False)
    states: Bdd = field(repr=False)
    rows: tuple[str, ...] = field(repr=False)

    def __init__(self, manager: DiagramManager, states: Bdd, rows: Sequence[str]) -> None:
        object.__setattr__(self, "manager", manager)
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "rows", tuple(rows))

    @cached_property
    def table(self) -> Table:
        """The diagram as arrays."""
        t = self.manager.export_bdd(self.states)
        return kernel.build(t.level, t.low, t.high, _TRUTH, t.root, self.levels)

    @property
    def levels(self) -> NDArray[np.int32]:
        """The bits' levels in the manager's present order, int32[k]. ValueError where their order has changed."""
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

    # numbers and bits

    def unrank(self, indices: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Bits of the members with these numbers: uint8[m, k]. IndexError for a number out of range."""
        bits = np.empty((len(indices), len(self.rows)), np.uint8)
        kernel.unrank(*self.table, np.ascontiguousarray(indices, np.int64), bits)
        return bits

    def rank(self, bits: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Numbers of the members with these bits (uint8[m, k]); -1 for what is no member."""
        out = np.empty(len(bits), np.int64)
        kernel.rank(
            *self.table,
            np.ascontiguousarray(bits, np.uint8).reshape(len(bits), len(self.rows)),
            out,
        )
        return out

    def weigh(self, weights: NDArray[np.int64], offset: int = 0) -> NDArray[np.int64]:
        """For each member, offset plus the weights of its bits that are 1: int64[count].

        With powers of two on a variable's bits, and its least value as the offset, these are the variable's values.
        """
        out = np.empty(self.count, np.int64)
        kernel.emit(*self.table, np.ascontiguousarray(weights, np.int64), offset, out)
        return out

    def words(self) -> NDArray[np.uint64]:
        """All members as packed bits, uint64[count, ceil(k / 64)]: the last bit is the lowest of the last word."""
        k = len(self.rows)
        words = max(1, -(-k // 64))
        exponent = np.arange(k)[::-1]
        out = np.empty((self.count, words), np.uint64)
        for word in range(words):
            here = exponent // 64 == words - 1 - word
            weights = np.where(
                here, np.uint64(1) << (exponent % 64).astype(np.uint64), np.uint64(0)
            )
            out[:, word] = self.weigh(weights.view(np.int64)).view(np.uint64)
        return out

    def places(self, other: Odd) -> NDArray[np.int64]:
        """Number in `other`, a superset over the same bits, of each member of this set: int64[count]."""
        if not self.states <= other.states or self.rows != other.rows:
            raise ValueError("places are asked for in a set that is not a superset")
        out = np.empty(self.count, np.int64)
        kernel.embed(self.table, other.table, out)
        return out

    # diagrams and arrays

    def expand(self, states: Bdd) -> NDArray[np.bool_]:
        """Which members are in another set: bool[count]."""
        t = self.manager.export_bdd(states)
        out = np.zeros(self.count, np.uint8)
        vectors.expand(*self.table, t.level, t.low, t.high, _TRUTH, t.root, self.levels, out)
        return out.view(np.bool_)

    def collapse(self, members: NDArray[np.bool_]) -> Bdd:
        """The set of the members that are True (bool[count])."""
        if len(members) != self.count:
            raise ValueError(f"{len(members)} truth values for {self.count} members")
        bits = np.zeros(len(members) // 64 + 2, np.uint64)
        packed = np.packbits(members, bitorder="little")
        bits.view(np.uint8)[: len(packed)] = packed
        levels, bottom = self.levels, len(self.manager.bdd.vars)
        level, low, high, root = vectors.collapse(*self.table, bits, levels, bottom)
        return self.manager.import_bdd(
            BddTable(bottom, level, low, high, np.array([root], np.int32))
        )[0]

    def to_vector(self, function: Mtbdd) -> NDArray[np.float64]:
        """Values of a function of the bits at the members: float64[count]."""
        t = self.manager.export_mtbdd(function)
        out = np.zeros(self.count)
        vectors.expand(*self.table, t.level, t.low, t.high, t.values, t.root, self.levels, out)
        return out

    def from_vector(self, values: NDArray[np.float64]) -> Mtbdd:
        """The function with these values (float64[count]) at the members and 0 elsewhere. -0.0 becomes 0."""
        if len(values) != self.count:
            raise ValueError(f"{len(values)} values for {self.count} members")
        ids = np.empty(len(values), np.int32)
        leaves = vectors.number(np.ascontiguousarray(values, np.float64), ids)
        levels, bottom = self.levels, len(self.manager.bdd.vars)
        level, low, high, root = vectors.vector_table(*self.table, ids, len(leaves), levels, bottom)
        return self.manager.import_mtbdd(
            NodeTable(bottom, level, low, high, leaves, np.array([root], np.int32))
        )[0]


def levels_of(manager: DiagramManager, names: Sequence[str]) -> NDArray[np.int32]:
    """Levels of variables that must be given from the top down: int32[k]. ValueError where they are not."""
    levels = np.array([manager.level_of(name) for name in names], np.int32)
    if (np.diff(levels) <= 0).any():
        raise ValueError(
            "the bits are not in the order of the diagrams (was the manager reordered?)"
        )
    return levels
