"""From matrix diagrams to compressed rows, and to blocks that are multiplied without ever writing the matrix out.

Both come from the quad-DAG (`symcheck.kernels.quad`): distinct sub-matrices are found once each and stamped wherever
they stand. Rows and columns are the members of two ODDs, over row and column bits that alternate in the diagrams.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.odd import Odd, levels_of
from symcheck.errors import MemoryLimitError
from symcheck.kernels.quad import Blocks, Quad

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["BlockMatrix", "RowLayout", "blocks", "flatten", "quad_dag"]

Floats = NDArray[np.float64]

BUDGET = 60_000
"""Runs in distinct blocks: about half a megabyte, so that they stay in a core's cache while places stream by."""


@dataclass(frozen=True, eq=False)
class RowLayout:
    """Which rows there are when each state has a row in some of several matrices (slots).

    groups: int64[n+1], rows groups[s] .. groups[s+1] belong to state s, in the order of the slots.
    slots: int32[rows], the slot of each row.
    rows: per slot the row numbers, int64, in the order of the states that have one; `present`: bool[n] says which do.
    """

    groups: NDArray[np.int64]
    slots: NDArray[np.int32]
    rows: tuple[NDArray[np.int64], ...] = field(repr=False)
    present: tuple[NDArray[np.bool_], ...] = field(repr=False)

    @staticmethod
    def of(present: Sequence[NDArray[np.bool_]], n: int) -> RowLayout:
        """The layout for slots that are present in these states (bool[n] each)."""
        counts = np.zeros(n, np.int64)
        for slot in present:
            counts += slot
        groups = np.zeros(n + 1, np.int64)
        np.cumsum(counts, out=groups[1:])
        slots = np.empty(int(groups[-1]), np.int32)
        following = groups[:-1].copy()
        rows = []
        for number, slot in enumerate(present):
            here = following[slot]
            slots[here] = number
            following += slot
            rows.append(here)
        return RowLayout(groups, slots, tuple(rows), tuple(present))

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, in bytes."""
        parts: tuple[NDArray[Any], ...] = (self.groups, self.slots, *self.rows, *self.present)
        return sum(part.nbytes for part in parts)


def quad_dag(matrices: Sequence[Mtbdd], row: Odd, column: Odd, columns: Sequence[str]) -> Quad:
    """The quad-DAG of matrices over the bits `row.rows` and `columns` (alternating from the top of the diagrams down).

    row: the rows, as states; column: the columns, also as states over *row* bits (they may be other states).
    Raises OverflowError for 2**31 rows or columns or more, ValueError where a matrix depends on other variables.
    """
    if row.rows != column.rows:
        raise ValueError("rows and columns are over different bits")
    t = row.manager.export_mtbdd(list(matrices))
    row_levels, col_levels = row.levels, levels_of(row.manager, columns)
    merged = np.stack([row_levels, col_levels], axis=1).reshape(-1)
    if (np.diff(merged) <= 0).any():
        raise ValueError("row and column bits do not alternate in the diagrams")
    return Quad(t.level, t.low, t.high, t.values, t.roots, row.table, column.table, row_levels, col_levels)


def flatten(quad: Quad, layout: RowLayout | None = None) -> tuple[NDArray[np.int64], NDArray[np.int32], Floats]:
    """Compressed rows (indptr int64, indices int32 ascending in each row, data float64) of the matrices of a quad-DAG.

    One matrix, or several with a layout that groups their rows by state. Raises MemoryLimitError (before anything is
    allocated) where the machine's memory would not do, OverflowError for more columns than int32 numbers.
    """
    entries = int(quad.entries.sum())
    _require_memory(12 * entries + 24 * quad.rows)
    stamps = quad.cut(BUDGET)
    counts = np.zeros(quad.rows, np.int32)
    if layout is None:
        stamps.count_rows(0, counts)
        indptr = np.zeros(quad.rows + 1, np.int64)
        np.cumsum(counts, out=indptr[1:])
    else:
        indptr = np.zeros(len(layout.slots) + 1, np.int64)
        for slot, rows in enumerate(layout.rows):
            counts[:] = 0
            stamps.count_rows(slot, counts)
            indptr[rows + 1] = counts[layout.present[slot]]
        np.cumsum(indptr, out=indptr)
    if indptr[-1] != entries:
        raise ValueError("a matrix has entries in rows that the layout leaves out")
    indices, data = np.empty(entries, np.int32), np.empty(entries)
    following = indptr[:-1].copy() if layout is None else indptr[layout.groups[:-1]]
    for slot in range(len(quad.entries)):
        stamps.fill(slot, following, indices, data)
    return indptr, indices, data


def _require_memory(size: int) -> None:
    from symcheck.dd.manager import default_memory

    if size > default_memory():
        raise MemoryLimitError(
            f"the rows of the matrix would take {size / 2**30:.1f} GiB, more than this machine should spend: "
            f"the hybrid engine (-h) stores repeated blocks once"
        )


@dataclass(frozen=True, eq=False)
class BlockMatrix:
    """Matrices as blocks: `multiply` without compressed rows, in a small part of their memory.

    shape: rows × columns; with a layout, rows are choices grouped by state.
    """

    stamps: Blocks
    layout: RowLayout | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return (self.stamps.rows if self.layout is None else len(self.layout.slots)), self.stamps.columns

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
        """Sizes: blocks, runs, places, entries."""
        return self.stamps.statistics

    def multiply(self, x: Floats, out: Floats | None = None) -> Floats:
        """A x, per row: float64[rows]. `out` is overwritten and returned if given. Releases the interpreter lock."""
        x = np.ascontiguousarray(x, np.float64)
        out = np.empty(self.shape[0]) if out is None else out
        if self.layout is None:
            out[:] = 0
            self.stamps.multiply(0, x, out)
            return out
        part = np.empty(self.stamps.rows)
        for slot, rows in enumerate(self.layout.rows):
            part[:] = 0
            self.stamps.multiply(slot, x, part)
            out[rows] = part[self.layout.present[slot]]
        return out

    def optimum(self, x: Floats, constant: Floats | None, direction: str) -> Floats:
        """Per state the least ('min') or greatest ('max') over its rows of constant + A x: float64[states].

        States without a row get +inf ('min') or -inf ('max').
        """
        if self.layout is None:
            out = self.multiply(x)
            return out if constant is None else out + constant
        pick, start = (np.minimum, np.inf) if direction == "min" else (np.maximum, -np.inf)
        best = np.full(self.stamps.rows, start)
        part = np.empty(self.stamps.rows)
        for slot, present in enumerate(self.layout.present):
            part[:] = 0
            self.stamps.multiply(slot, np.ascontiguousarray(x, np.float64), part)
            if constant is not None:
                part[present] += constant[self.layout.rows[slot]]
            pick(best, part, out=best, where=present)
        return best

    def multiply_transposed(self, x: Floats, out: Floats | None = None) -> Floats:
        """The product from the left, x A, per column: float64[columns]."""
        out = np.empty(self.stamps.columns) if out is None else out
        out[:] = 0
        if self.layout is None:
            self.stamps.multiply_transposed(0, np.ascontiguousarray(x, np.float64), out)
            return out
        part = np.empty(self.stamps.rows)
        for slot, rows in enumerate(self.layout.rows):
            part[:] = 0
            part[self.layout.present[slot]] = x[rows]
            self.stamps.multiply_transposed(slot, part, out)
        return out

    def row_sums(self) -> Floats:
        """Sum of each row: float64[rows]."""
        return self.multiply(np.ones(self.shape[1]))

    def diagonal(self) -> Floats:
        """The diagonal of a square matrix without choices: float64[n]."""
        out = np.zeros(min(self.stamps.rows, self.stamps.columns))
        self.stamps.diagonal(0, out)
        return out


def blocks(quad: Quad, layout: RowLayout | None = None, budget: int = BUDGET) -> BlockMatrix:
    """The matrices of a quad-DAG as blocks, with about `budget` runs in all where that is possible."""
    return BlockMatrix(quad.cut(budget), layout)
