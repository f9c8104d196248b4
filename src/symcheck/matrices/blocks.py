"""From matrix diagrams to compressed rows, and to blocks that are multiplied without ever writing
the matrix out.

Both come from the quad-DAG (`symcheck.kernels.diagrams.quad_dag`): distinct sub-matrices are found
once each and stamped wherever they stand. Rows and columns are the members of two ODDs, over row
and column bits that alternate in the diagrams.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.odd import Odd, levels_of
from symcheck.direction import Direction
from symcheck.errors import MemoryLimitError
from symcheck.kernels.arrays import Floats
from symcheck.kernels.blocks.block_matrix import Blocks
from symcheck.kernels.diagrams.quad_dag import Quad
from symcheck.kernels.graph.components import components

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["BlockMatrix", "RowLayout", "blocks", "flatten", "quad_dag"]

BUDGET = 60_000
"""Runs in distinct blocks: about half a megabyte, so that they stay in a core's cache while places
stream by.
"""

ALONE, TOGETHER = 1000, 2
"""How often a sweep repeats a range of rows at most: one that waits for no other, and one that
takes turns with others.
"""

THREADED = 2_000_000
"""Entries from which a product is worth a second thread (starting it takes some 50 µs)."""


@dataclass(frozen=True, eq=False)
class RowLayout:
    """Which rows there are when each state has a row in some of several matrices (slots).

    groups: int64[n+1], rows groups[s] .. groups[s+1] belong to state s, in the order of the slots.
    present: uint8[slots, ceil(n / 8)], which states have a row in which slot: bit s % 8 of byte s
    // 8.
    """

    groups: NDArray[np.int64]
    present: NDArray[np.uint8] = field(repr=False)

    @staticmethod
    def of(present: Sequence[NDArray[np.bool_]], n: int) -> RowLayout:
        """The layout for slots that are present in these states (bool[n] each)."""
        groups = np.zeros(n + 1, np.int64)
        packed = np.empty((len(present), -(-n // 8)), np.uint8)
        for number, slot in enumerate(present):
            groups[1:] += slot
            packed[number] = np.packbits(slot, bitorder="little")
        np.cumsum(groups, out=groups)
        return RowLayout(groups, packed)

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.groups) - 1

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self.groups[-1])

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, in bytes."""
        return self.groups.nbytes + self.present.nbytes

    def states_of(self, slot: int) -> NDArray[np.bool_]:
        """Which states have a row in the slot: bool[n]."""
        return np.unpackbits(self.present[slot], count=self.n, bitorder="little").view(np.bool_)

    def each(self) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.int64]]]:
        """Per slot: which states have a row in it (bool[n]), and the numbers of these rows."""
        following = self.groups[:-1].copy()
        for slot in range(len(self.present)):
            here = self.states_of(slot)
            yield here, following[here]
            following += here

    @property
    def slots(self) -> NDArray[np.int32]:
        """The slot of each row: int32[rows]."""
        out = np.empty(self.rows, np.int32)
        for slot, (_, rows) in enumerate(self.each()):
            out[rows] = slot
        return out


def quad_dag(matrices: Sequence[Mtbdd], row: Odd, column: Odd, columns: Sequence[str]) -> Quad:
    """The quad-DAG of matrices over the bits `row.rows` and `columns` (alternating from the top of
    the diagrams down).

    row: the rows, as states; column: the columns, also as states over *row* bits (they may be other
    states). Raises OverflowError for 2**31 rows or columns or more, ValueError where a matrix
    depends on other variables.
    """
    if row.rows != column.rows:
        raise ValueError("rows and columns are over different bits")
    t = row.manager.export_mtbdd(list(matrices))
    row_levels, col_levels = row.levels, levels_of(row.manager, columns)
    merged = np.stack([row_levels, col_levels], axis=1).reshape(-1)
    if (np.diff(merged) <= 0).any():
        raise ValueError("row and column bits do not alternate in the diagrams")
    return Quad(
        t.level, t.low, t.high, t.values, t.roots, row.table, column.table, row_levels, col_levels
    )


def flatten(
    quad: Quad, layout: RowLayout | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int32], Floats]:
    """Compressed rows (indptr int64, indices int32 ascending in each row, data float64) of the
    matrices of a quad-DAG.

    One matrix, or several with a layout that groups their rows by state. Raises MemoryLimitError
    (before anything is allocated) where the machine's memory would not do, OverflowError for more
    columns than int32 numbers.
    """
    entries = int(quad.entries.sum())
    _require_memory(12 * entries + 24 * quad.rows)
    stamps = Blocks(quad, BUDGET, ordered=True)
    indptr = np.zeros((quad.rows if layout is None else layout.rows) + 1, np.int64)
    if layout is None:
        counts = np.zeros(quad.rows, np.int32)
        stamps.count_rows(0, counts)
        np.cumsum(counts, out=indptr[1:])
    else:
        if not stamps.count_choices(layout.groups, layout.present, indptr[1:]):
            raise ValueError("a matrix has entries in rows that the layout leaves out")
        np.cumsum(indptr, out=indptr)
    indices, data = np.empty(entries, np.int32), np.empty(entries)
    following = indptr[:-1].copy() if layout is None else indptr[layout.groups[:-1]]
    for slot in range(len(quad.entries)):
        stamps.fill(slot, following, indices, data)
    return indptr, indices, data


def _require_memory(size: int) -> None:
    from symcheck.dd.manager import default_memory

    if size > default_memory():
        raise MemoryLimitError(
            f"the rows of the matrix would take {size / 2**30:.1f} GiB, more than this machine "
            "should spend: "
            f"the hybrid engine (-h) stores repeated blocks once"
        )


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """Matrices as blocks: products without compressed rows, in a small part of their memory.

    shape: rows × columns; with a layout, rows are choices grouped by state. Large products use
    `threads` threads (None: the processors that there are, at most 4); the result does not depend
    on their number, digit for digit.
    """

    stamps: Blocks
    layout: RowLayout | None = None
    threads: int | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return (self.stamps.rows if self.layout is None else self.layout.rows), self.stamps.columns

    @property
    def entries(self) -> int:
        """Number of non-zero entries."""
        return int(self.stamps.entries.sum())

    @property
    def nbytes(self) -> int:
        """Memory, in bytes."""
        return self.stamps.nbytes + (0 if self.layout is None else self.layout.nbytes)

    @property
    def statistics(self) -> Mapping[str, int]:
        """Sizes: blocks, runs, places, parts, entries."""
        return self.stamps.statistics

    @cached_property
    def _shares(self) -> list[tuple[int, int]]:
        """Ranges of parts with about the same work, one per thread."""
        count = self.threads or min(4, len(os.sched_getaffinity(0)))
        work = np.cumsum(self.stamps.part_work)
        if self.threads is None and self.entries < THREADED:
            count = 1
        cuts = (
            np.searchsorted(work, work[-1] * np.arange(1, count) / count) + 1 if len(work) else []
        )
        ends = np.unique([0, *cuts, self.stamps.parts])
        return list(pairwise(ends.tolist()))

    def _run(self, part: Callable[[int, int], None]) -> None:
        """Call part(first, last) on all parts, each share on a thread of its own."""
        if len(self._shares) == 1:
            part(0, -1)
            return
        from concurrent.futures import ThreadPoolExecutor

        first, *others = self._shares
        with ThreadPoolExecutor(len(others)) as pool:
            waiting = [pool.submit(part, *share) for share in others]
            part(*first)
            for each in waiting:
                each.result()

    def multiply(self, x: Floats, out: Floats | None = None) -> Floats:
        """A x, per row: float64[rows]. `out` is overwritten and returned if given. Releases the
        interpreter lock.
        """
        x = np.ascontiguousarray(x, np.float64)
        y = np.empty(self.shape[0]) if out is None else out
        layout = self.layout
        if layout is None:
            self._run(lambda first, last: self.stamps.multiply(0, x, y, first, last))
        else:
            groups, present = layout.groups, layout.present
            self._run(
                lambda first, last: self.stamps.multiply_choices(x, groups, present, y, first, last)
            )
        return y

    def optimum(
        self, x: Floats, constant: Floats | None, direction: Direction, out: Floats | None = None
    ) -> Floats:
        """Per state the least ('min') or greatest ('max') over its rows of constant + A x:
        float64[states].

        States without a row get +inf ('min') or -inf ('max').
        """
        if self.layout is None:
            product = self.multiply(x, out)
            return product if constant is None else np.add(product, constant, out=product)
        x = np.ascontiguousarray(x, np.float64)
        y = np.empty(self.stamps.rows) if out is None else out
        add = np.empty(0) if constant is None else np.ascontiguousarray(constant, np.float64)
        groups, present, greatest = (
            self.layout.groups,
            self.layout.present,
            direction == Direction.MAX,
        )
        self._run(
            lambda first, last: self.stamps.optimum(
                x, add, groups, present, greatest, y, first, last
            )
        )
        return y

    @cached_property
    def longest(self) -> int:
        """Number of entries of the longest row."""
        counts = np.zeros(self.stamps.rows, np.int32)
        longest = 0
        for slot in range(self.stamps.roots):
            counts[:] = 0
            self.stamps.count_rows(slot, counts)
            longest = max(longest, int(counts.max(initial=0)))
        return longest

    def sweep(
        self,
        x: Floats,
        constant: Floats,
        direction: Direction | None,
        slip: float,
        *,
        upper: bool,
        divisor: Floats | None = None,
    ) -> None:
        """Tighten bounds on the solution of x = opt(A x / divisor + constant), in place, there and
        back through the rows.

        x: float64[n], lower bounds, or upper bounds (`upper`). constant, divisor: per row, not
        negative. Values are moved outwards by the relative `slip`, which must cover the rounding of
        a step.

        Ranges of rows are taken in an order in which they use each other's new values. A range that
        no other waits for is repeated until it stands still; those that use each other take turns,
        there and back.
        """
        groups, present = (
            (None, None) if self.layout is None else (self.layout.groups, self.layout.present)
        )
        by = np.empty(0) if divisor is None else np.ascontiguousarray(divisor, np.float64)
        for parts, turns in self._schedule:
            self.stamps.sweep(
                x,
                constant,
                by,
                groups,
                present,
                direction == Direction.MAX,
                upper,
                slip,
                parts,
                turns,
            )

    @cached_property
    def _schedule(self) -> list[tuple[NDArray[np.int32], int]]:
        """Groups of row ranges that use each other, users last, and how often a range is repeated
        in a sweep.
        """
        uses = self.stamps.uses()
        indptr = np.concatenate(([0], np.cumsum(uses.sum(axis=1)))).astype(np.int64)
        _, order, start = components(indptr, np.nonzero(uses)[1].astype(np.int32))
        schedule = []
        for first, last in pairwise(start.tolist()):
            parts = np.sort(order[first:last]).astype(np.int32)
            if len(parts) == 1:
                schedule.append((parts, ALONE))
            else:
                schedule += [(np.ascontiguousarray(parts[::-1]), TOGETHER), (parts, TOGETHER)]
        return schedule

    def multiply_transposed(self, x: Floats, out: Floats | None = None) -> Floats:
        """The product from the left, x A, per column: float64[columns]."""
        y = np.empty(self.stamps.columns) if out is None else out
        y[:] = 0
        if self.layout is None:
            self.stamps.multiply_transposed(0, np.ascontiguousarray(x, np.float64), y)
            return y
        part = np.empty(self.stamps.rows)
        for slot, (present, rows) in enumerate(self.layout.each()):
            part[:] = 0
            part[present] = x[rows]
            self.stamps.multiply_transposed(slot, part, y)
        return y

    def row_sums(self) -> Floats:
        """Sum of each row: float64[rows]."""
        return self.multiply(np.ones(self.shape[1]))

    def diagonal(self) -> Floats:
        """The diagonal of a square matrix without choices: float64[n]."""
        out = np.zeros(min(self.stamps.rows, self.stamps.columns))
        self.stamps.diagonal(0, out)
        return out


def blocks(
    quad: Quad, layout: RowLayout | None = None, budget: int = BUDGET, threads: int | None = None
) -> BlockMatrix:
    """The matrices of a quad-DAG as blocks, with about `budget` runs in all where that is possible."""
    return BlockMatrix(Blocks(quad, budget), layout, threads)
