"""Sparse matrices in compressed rows, with rows grouped into choices for an MDP. Entries are
float64 or rationals.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from symcheck.direction import Direction
from symcheck.kernels.arrays import Bools, Floats, Int32s, Int64s
from symcheck.kernels.rows import sparse, submatrix
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices import tuning
from symcheck.matrices.numbers import N, Numbers, doubles, is_rational, sum_segments
from symcheck.parallel.threads import even_shares, on_threads, thread_count

__all__ = [
    "Bools",
    "Floats",
    "Int32s",
    "Int64s",
    "SparseMatrix",
    "best_of_rows",
    "first_best",
    "per_row",
    "spans",
    "starts_of",
]


@dataclass(frozen=True, eq=False)
class SparseMatrix:
    """A sparse matrix in compressed rows: row r has columns `indices[indptr[r]:indptr[r+1]]`, each
    once, and `data` alike.

    Attributes:
        indptr: int64[rows+1].
        indices: int32[entries]; more than 2**31 - 1 states raise OverflowError on building.
        data: float64[entries], or Fractions as objects.
        columns: number of columns.
        groups: int64[states+1]; rows groups[s] to groups[s+1] - 1 are the choices of state s. None:
            a row per state.
    """

    indptr: Int64s
    indices: Int32s
    data: Numbers
    columns: int
    groups: Int64s | None = None

    @property
    def rows(self) -> int:
        """Number of rows (choices)."""
        return len(self.indptr) - 1

    @property
    def states(self) -> int:
        """Number of row groups (states)."""
        return self.rows if self.groups is None else len(self.groups) - 1

    @property
    def arrays(self) -> tuple[Int64s, Int32s, Floats]:
        """`indptr`, `indices` and `data`, as compiled loops take them."""
        return self.indptr, self.indices, self.data

    @property
    def lengths(self) -> Int64s:
        """Number of entries of each row."""
        return np.diff(self.indptr)

    @property
    def longest(self) -> int:
        """Number of entries of the longest row."""
        return int(np.max(self.lengths, initial=0))

    @property
    def entries(self) -> int:
        """Number of stored entries."""
        return int(self.indptr[-1])

    @property
    def row_of_entry(self) -> Int64s:
        """The row of each entry."""
        return np.repeat(np.arange(self.rows), self.lengths)

    @property
    def state_of_row(self) -> Int64s:
        """The state of each row."""
        if self.groups is None:
            return np.arange(self.rows)
        return np.repeat(np.arange(self.states), np.diff(self.groups))

    def find(self, rows: Int64s, columns: Int64s | Int32s) -> tuple[Int64s, Bools]:
        """The number of the entry in each of these places, and whether there is one."""
        keys = self.row_of_entry * self.columns + self.indices
        by = np.argsort(keys, kind="stable")
        sought = rows * self.columns + columns
        position = by[np.minimum(np.searchsorted(keys[by], sought), len(keys) - 1)]
        return position, keys[position] == sought

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, in bytes."""
        total = self.indptr.nbytes + self.indices.nbytes + self.data.nbytes
        return total + (0 if self.groups is None else self.groups.nbytes)

    @property
    def is_rational(self) -> bool:
        """Whether the entries are rationals."""
        return is_rational(self.data)

    def doubles(self) -> SparseMatrix:
        """The matrix with the nearest doubles as entries."""
        return replace(self, data=doubles(self.data)) if self.is_rational else self

    def multiply(self, x: Numbers) -> Numbers:
        """The product with a vector (one number per column): one number per row."""
        if self.is_rational:
            return sum_segments(self.data * x[self.indices], self.indptr)
        out, (indptr, indices, data) = np.empty(self.rows), self.arrays

        def part(first: int, end: int) -> None:
            sparse.multiply(indptr[first : end + 1], indices, data, x, out[first:end])

        on_threads(part, self.shares())
        return out

    def multiply_left(self, x: Floats) -> Floats:
        """The product of a vector (one number per row) with the matrix of doubles."""
        out = np.zeros(self.columns)
        sparse.multiply_left(*self.arrays, x, out)
        return out

    def shares(self) -> list[int]:
        """Where the rows of each thread begin, and their number; large products have several."""
        is_large = self.entries >= tuning.MIN_THREADED_ROWS_ENTRIES
        return even_shares(self.indptr, thread_count() if is_large else 1)

    def row_sums(self) -> Floats:
        """The sum of each row of doubles."""
        return sparse.row_sums(self.indptr, self.data)

    def divided(self, divisor: Numbers) -> SparseMatrix:
        """The matrix with each row divided by a number."""
        return replace(self, data=self.data / np.repeat(divisor, self.lengths))

    def select(
        self, rows: Int64s | Int32s, index: Int32s, columns: int, groups: Int64s | None = None
    ) -> SparseMatrix:
        """The chosen rows, with only the columns c where index[c] >= 0, renumbered to index[c]."""
        indptr, indices, data = sparse.select(
            self.indptr, self.indices, self.handles, np.asarray(rows, np.int64), index
        )
        return SparseMatrix(indptr, indices, self.from_handles(data), columns, groups)

    def choose(self, rows: Int64s, groups: Int64s | None = None) -> SparseMatrix:
        """The chosen rows with all columns."""
        return self.select(rows, np.arange(self.columns, dtype=np.int32), self.columns, groups)

    def merge(self, class_of: Int32s, columns: int) -> SparseMatrix:
        """The matrix with columns renumbered by `class_of` (many to one); entries that coincide are
        added.
        """
        if not self.is_rational:
            return SparseMatrix(
                *sparse.merge_columns(self.indptr, self.indices, self.data, class_of, columns),
                columns,
                self.groups,
            )
        keys = self.row_of_entry * columns + class_of[self.indices]
        keys, inverse = np.unique(keys, return_inverse=True)
        order = np.argsort(inverse, kind="stable")
        starts = starts_of(np.bincount(inverse, minlength=len(keys)))
        return SparseMatrix(
            starts_of(np.bincount(keys // columns, minlength=self.rows)),
            (keys % columns).astype(np.int32),
            sum_segments(self.data[order], starts),
            columns,
            self.groups,
        )

    def among(self, states: Bools) -> SparseMatrix:
        """The submatrix of the chosen states, renumbered in order."""
        indptr, indices, data = submatrix.select_states(
            self.indptr, self.indices, self.handles, self.groups, states.view(np.uint8)
        )
        count, groups = int(np.count_nonzero(states)), self.groups_of(states)
        return SparseMatrix(indptr, indices, self.from_handles(data), count, groups)

    def rows_of(self, states: Bools) -> Bools:
        """Which rows belong to the chosen states: bool[rows]."""
        return states if self.groups is None else np.repeat(states, np.diff(self.groups))

    def groups_of(self, states: Bools) -> Int64s | None:
        """The groups of the submatrix of the chosen states."""
        return None if self.groups is None else starts_of(np.diff(self.groups)[states])

    def sums(self, states: Bools, columns: Bools, values: Numbers | None = None) -> Numbers:
        """Per row of the chosen states, the sum over chosen columns of the entry, or of entry times
        value.
        """
        if not self.is_rational:
            chosen, member = states.view(np.uint8), columns.view(np.uint8)
            return submatrix.sum_columns(
                self.indptr, self.indices, self.data, self.groups, chosen, member, values
            )
        rows = self.rows_of(states)
        entries = np.repeat(rows, self.lengths) & columns[self.indices]
        terms = self.data[entries]
        if values is not None:
            terms = terms * values[self.indices[entries]]
        return sum_segments(terms, starts_of(entries)[self.indptr])[rows]

    @property
    def handles(self) -> Floats:
        """What a compiled loop moves in place of the entries: doubles themselves, and places of
        rationals.
        """
        return np.arange(self.entries, dtype=np.float64) if self.is_rational else self.data

    def from_handles(self, handles: Floats) -> Numbers:
        """The entries that belong to handles which a compiled loop has moved."""
        return self.data[handles.astype(np.int64)] if self.is_rational else handles


def best_of_rows(
    values: N, groups: Int64s | None, direction: Direction | None, opponents: Bools | None = None
) -> N:
    """The least or greatest value of the rows of each state; the values themselves without choices.

    Args:
        values: one per row.
        groups: rows groups[s] to groups[s+1] - 1 belong to state s; None: a row per state.
        direction: the least or the greatest value; None without choices.
        opponents: the states whose value is the other one, bool[n]; None: there are none.
    """
    if groups is None or len(values) == 0:
        return values
    fold = np.maximum if direction == Direction.MAX else np.minimum
    if opponents is None:
        return fold.reduceat(values, groups[:-1])
    sign = np.where(opponents, -1, 1)
    return fold.reduceat(values * per_row(groups, sign), groups[:-1]) * sign


def first_best(values: Numbers, groups: Int64s) -> Int64s:
    """The first row with the greatest value in each group of rows: int64[groups]."""
    best = np.repeat(np.maximum.reduceat(values, groups[:-1]), np.diff(groups))
    rows = np.flatnonzero(values == best)
    _, first = np.unique(np.searchsorted(groups, rows, side="right"), return_index=True)
    return rows[first]


def per_row(groups: Int64s | None, states: Numbers) -> Numbers:
    """A value per state, repeated for each of its rows."""
    return states if groups is None else np.repeat(states, np.diff(groups))


def starts_of(sizes: ArrayLike) -> Int64s:
    """Offsets of parts of these sizes, and their total: int64[n+1]."""
    sizes = np.asarray(sizes)
    out = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=out[1:])
    return out


def spans(starts: Int64s, ends: Int64s) -> Int64s:
    """The members of the half-open ranges starts[i] to ends[i], one range after the other:
    int64[m].
    """
    after = starts_of(ends - starts)
    return np.asarray(np.arange(after[-1]) + np.repeat(starts - after[:-1], ends - starts))
