"""From matrix diagrams to compressed rows, and to block matrices that are multiplied without
writing the rows out.

Both come from the quad-DAG (`symcheck.kernels.diagrams.quad_dag`), which has each distinct
sub-matrix once. Compressed rows copy a block to all its occurrences; a block matrix stores it once.
Rows and columns are the members of two ODDs, over row and column bits that alternate in the
diagrams.

Source: Parker (2002), Implementation of symbolic model checking for probabilistic systems, chapter
6 (the hybrid engine: sparse blocks at a fixed depth). Here blocks are shared sub-matrices of any
size, stored as diagonal runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.odd import Odd, levels_of
from symcheck.direction import Direction
from symcheck.errors import MemoryLimitError
from symcheck.kernels.arrays import Floats, Int64s
from symcheck.kernels.blocks.block_matrix import BlockOperations
from symcheck.kernels.diagrams.quad_dag import QuadDag
from symcheck.kernels.graph.components import components
from symcheck.matrices import tuning
from symcheck.matrices.operators import BoundStep, underflow_error
from symcheck.parallel.threads import even_shares, on_threads, thread_count

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["BlockMatrix", "RowLayout", "blocks", "flatten", "quad_dag"]


@dataclass(frozen=True, eq=False)
class RowLayout:
    """The rows of several matrices (choice classes) in each of which a state may have a row.

    Attributes:
        groups: int64[n+1]; rows groups[s] to groups[s+1] - 1 belong to state s, in the order of the
            classes.
        present: uint8[classes, ceil(n / 8)]; bit s % 8 of byte s // 8 tells whether state s has a
            row in the class.
    """

    groups: NDArray[np.int64]
    present: NDArray[np.uint8] = field(repr=False)

    @staticmethod
    def of(present: Sequence[NDArray[np.bool_]], n: int) -> RowLayout:
        """The layout for choice classes that are present in these states (bool[n] each)."""
        groups = np.zeros(n + 1, np.int64)
        packed = np.empty((len(present), -(-n // 8)), np.uint8)
        for number, choice_class in enumerate(present):
            groups[1:] += choice_class
            packed[number] = np.packbits(choice_class, bitorder="little")
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

    def states_of(self, choice_class: int) -> NDArray[np.bool_]:
        """The states with a row in a choice class: bool[n]."""
        return np.unpackbits(self.present[choice_class], count=self.n, bitorder="little").view(
            np.bool_
        )

    def each(self) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.int64]]]:
        """Per choice class, the states with a row in it (bool[n]) and the numbers of these rows."""
        following = self.groups[:-1].copy()
        for choice_class in range(len(self.present)):
            here = self.states_of(choice_class)
            yield here, following[here]
            following += here


def quad_dag(matrices: Sequence[Mtbdd], row: Odd, column: Odd, columns: Sequence[str]) -> QuadDag:
    """The quad-DAG of matrices over the bits `row.rows` and `columns`, which alternate from the top
    of the diagrams down.

    Args:
        matrices: MTBDDs over the row and column bits.
        row: the ODD of the states that are rows.
        column: the ODD of the states that are columns, over row bits as well.
        columns: the column bits.

    Raises:
        OverflowError: 2**31 rows or columns or more.
        ValueError: a matrix depends on other variables.
    """
    if row.rows != column.rows:
        raise ValueError("rows and columns are over different bits")
    t = row.manager.export_mtbdd(list(matrices))
    row_levels, col_levels = row.levels, levels_of(row.manager, columns)
    merged = np.stack([row_levels, col_levels], axis=1).reshape(-1)
    if (np.diff(merged) <= 0).any():
        raise ValueError("row and column bits do not alternate in the diagrams")
    return QuadDag(
        t.level, t.low, t.high, t.values, t.roots, row.table, column.table, row_levels, col_levels
    )


def flatten(
    quad: QuadDag, layout: RowLayout | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int32], Floats]:
    """The matrices of a quad-DAG as compressed rows.

    Args:
        quad: the matrices.
        layout: groups the rows of several matrices by state; None for one matrix.

    Returns:
        indptr int64[rows+1], indices int32[entries] ascending in each row, data float64[entries].

    Raises:
        MemoryLimitError: before anything is allocated, if the rows need more than three quarters of
            the memory.
        OverflowError: more columns than int32 can number.
    """
    entries = int(quad.entries.sum())
    _require_memory(12 * entries + 24 * quad.rows)
    operations = BlockOperations(quad, tuning.MAX_BLOCK_RUNS, ordered=True)
    indptr = np.zeros((quad.rows if layout is None else layout.rows) + 1, np.int64)
    if layout is None:
        counts = np.zeros(quad.rows, np.int32)
        operations.count_entries(0, counts)
        np.cumsum(counts, out=indptr[1:])
    else:
        if not operations.count_choice_entries(layout.groups, layout.present, indptr[1:]):
            raise ValueError("a matrix has entries in rows that the layout leaves out")
        np.cumsum(indptr, out=indptr)
    indices, data = np.empty(entries, np.int32), np.empty(entries)
    following = indptr[:-1].copy() if layout is None else indptr[layout.groups[:-1]]
    for slot in range(len(quad.entries)):
        operations.fill_rows(slot, following, indices, data)
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
    """Matrices as blocks: products need no compressed rows, and a small part of their memory.

    Args:
        layout: groups the rows of several matrices by state; None for one matrix.
        divisor: a number per row by which products are divided, float64[rows]; None: 1.

    Large products use several threads; the results do not depend on their number.
    """

    operations: BlockOperations
    layout: RowLayout | None = None
    divisor: Floats | None = None

    def divided(self, divisor: Floats) -> BlockMatrix:
        """The matrices with each row divided by a number: float64[rows]."""
        return replace(self, divisor=divisor)

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns; with a layout, rows are choices grouped by state."""
        return (
            self.operations.rows if self.layout is None else self.layout.rows
        ), self.operations.columns

    @property
    def entries(self) -> int:
        """Number of non-zero entries."""
        return int(self.operations.entries.sum())

    @property
    def nbytes(self) -> int:
        """Memory, in bytes."""
        return self.operations.nbytes + (0 if self.layout is None else self.layout.nbytes)

    @property
    def statistics(self) -> Mapping[str, int]:
        """Numbers of blocks, runs, occurrences, ranges of rows and entries."""
        return self.operations.statistics

    @cached_property
    def _work(self) -> Int64s:
        """The work before each row range, and that of all."""
        return np.cumsum([0, *self.operations.range_work])

    @cached_property
    def _is_large(self) -> bool:
        """Whether a product has enough work for several threads."""
        return self.entries >= tuning.MIN_THREADED_ENTRIES

    def _run(self, part: Callable[[int, int], None]) -> None:
        """Call part(first, last) on all row ranges, each share on its own thread."""
        shares = even_shares(self._work, thread_count() if self._is_large else 1)
        on_threads(part, shares if len(shares) > 2 else [0, -1])

    def multiply(self, x: Floats) -> Floats:
        """The product A x: float64[rows]. Releases the interpreter lock."""
        x = np.ascontiguousarray(x, np.float64)
        y = np.empty(self.shape[0])
        layout = self.layout
        if layout is None:
            self._run(lambda first, last: self.operations.multiply(0, x, y, first, last))
        else:
            groups, present = layout.groups, layout.present
            self._run(
                lambda first, last: self.operations.multiply_choices(
                    x, groups, present, y, first, last
                )
            )
        return y if self.divisor is None else np.divide(y, self.divisor, out=y)

    @cached_property
    def longest(self) -> int:
        """The most entries of a row."""
        counts = np.zeros(self.operations.rows, np.int32)
        longest = 0
        for slot in range(self.operations.roots):
            counts[:] = 0
            self.operations.count_entries(slot, counts)
            longest = max(longest, int(counts.max(initial=0)))
        return longest

    def sweep(self, x: Floats, step: BoundStep) -> None:
        """Tighten bounds on the solution of an equation, in place, by sweeps in both directions.

        Ranges of rows are taken in an order in which they use each other's new values. A range that
        depends on no other is repeated until it converges; ranges that depend on each other
        alternate.

        Args:
            x: the bounds, float64[n].
            step: the equation.
        """
        groups, present = (
            (None, None) if self.layout is None else (self.layout.groups, self.layout.present)
        )
        divisor = np.empty(0) if self.divisor is None else self.divisor
        for parts, turns in self._schedule:
            self.operations.sweep(
                x,
                step.constant,
                divisor,
                groups,
                present,
                step.direction == Direction.MAX,
                step.upper,
                step.rounding_error,
                underflow_error(self.divisor),
                parts,
                turns,
            )

    @cached_property
    def _schedule(self) -> list[tuple[NDArray[np.int32], int]]:
        """Strong components of the dependencies between row ranges, dependents last, and the sweeps
        of each.
        """
        uses = self.operations.range_dependencies()
        indptr = np.concatenate(([0], np.cumsum(uses.sum(axis=1)))).astype(np.int64)
        _, order, start = components(indptr, np.nonzero(uses)[1].astype(np.int32))
        schedule = []
        for first, last in pairwise(start.tolist()):
            parts = np.sort(order[first:last]).astype(np.int32)
            if len(parts) == 1:
                schedule.append((parts, tuning.SWEEPS_OF_RANGE))
            else:
                schedule += [
                    (np.ascontiguousarray(parts[::-1]), tuning.SWEEPS_OF_COMPONENT),
                    (parts, tuning.SWEEPS_OF_COMPONENT),
                ]
        return schedule


def blocks(
    quad: QuadDag,
    layout: RowLayout | None = None,
    budget: int = tuning.MAX_BLOCK_RUNS,
) -> BlockMatrix:
    """The matrices of a quad-DAG as blocks, with about `budget` diagonal runs if possible."""
    return BlockMatrix(BlockOperations(quad, budget), layout)
