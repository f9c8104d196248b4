# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products with a matrix that is stored as blocks, and the conversion to compressed rows."""
from libc.math cimport INFINITY
cimport cython
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcpy, memset

from symcheck.kernels.blocks.block_operations cimport (clipped, columns, count, fill, multiply,
                                                       scatter)
from symcheck.kernels.blocks.diagonal_runs cimport Runs, SmallRun, WideRun
from symcheck.kernels.diagrams.quad_dag cimport Node, QuadDag

import numpy as np

__all__ = ["BlockOperations", "BlockPartition"]

include "_block_partition.pxi"


cdef inline int64_t _next_present(const uint8_t* present, int64_t s, int64_t end) noexcept nogil:
    """The first state from s on whose bit is set (bit s % 8 of byte s // 8), or `end`."""
    while s < end:
        if (s & 7) == 0 and present[s >> 3] == 0:
            s += 8
        elif (present[s >> 3] >> (s & 7)) & 1:
            return s
        else:
            s += 1
    return end


cdef inline void _improve_best(double value, int64_t row, const double[::1] constant,
                               const double[::1] divisor, bint greatest,
                               double* best) noexcept nogil:
    """Replace the best value by that of a row if the latter is better."""
    if divisor.shape[0]:
        value /= divisor[row]
    value += constant[row]
    if (value > best[0]) if greatest else (value < best[0]):
        best[0] = value


cdef double _tighten(double* x, const double* candidates, int64_t n, bint upper,
                     double rounding_error, double underflow) noexcept nogil:
    """Move bounds to new values, rounded outwards, where these are tighter; the greatest relative
    change.
    """
    cdef int64_t i
    cdef double value, greatest_change = 0
    for i in range(n):
        value = candidates[i]
        if upper:
            value = value * (1 + rounding_error) + underflow
            if value < x[i]:
                greatest_change = max(greatest_change, 1 - value / x[i])
                x[i] = value
        else:
            value = value * (1 - rounding_error) - underflow
            if value > x[i]:
                greatest_change = max(greatest_change, 1 - x[i] / value)
                x[i] = value
    return greatest_change


cdef class BlockOperations(BlockPartition):
    """The operations on a block partition.

    In all methods `root` is the number of a matrix, and arrays have the dtypes and shapes that are
    given; other lengths raise ValueError, and a number out of range IndexError. `first` and `last`
    delimit the row ranges to compute (last -1: to the end). Products release the interpreter lock.

    groups: int64[rows+1], the rows (choices) of each state. present: uint8[roots, ceil(rows / 8)],
    which states have a row in which root: bit s % 8 of byte s // 8.
    """

    cdef inline Runs _runs(self, const Block* block) noexcept nogil:
        """The runs of a block."""
        cdef Runs runs = Runs(NULL, NULL, block.runs)
        if block.wide:
            runs.wide = self.wide + block.start
        else:
            runs.small = self.small + block.start
        return runs

    cdef void _add_product(self, int64_t root, int64_t range_, const double* x,
                           double* y) noexcept nogil:
        """y += A x on a range of rows; y begins with the first row of the range."""
        cdef int64_t i, low = self.bounds[range_], high = self.bounds[range_ + 1]
        cdef Occurrence* occurrence
        cdef Block* block
        cdef const double* values = &self.values[0]
        cdef double* base = y - low
        for i in range(self.occurrence_start[root, range_],
                       self.occurrence_start[root, range_ + 1]):
            occurrence = &self.occurrences[i]
            block = &self.blocks[occurrence.block]
            if occurrence.row >= low and occurrence.row + block.rows <= high:
                multiply(self._runs(block), values, x + occurrence.col, base + occurrence.row)
            else:
                clipped(self._runs(block), values, x + occurrence.col, base + occurrence.row,
                        low - <int64_t>occurrence.row, high - <int64_t>occurrence.row)

    cdef void _multiply_range(self, int64_t root, int64_t range_, const double[::1] x, double* y,
                              int64_t* written) noexcept nogil:
        """y = A x on a range of rows.

        Before the call, y may differ from 0 in rows written[0] to written[1] only; afterwards these
        say so again.
        """
        cdef int64_t i, low = self.bounds[range_], high = self.bounds[range_
                                                                      + 1], first = high, last = low
        if written[1] > written[0]:
            memset(y + written[0] - low, 0, (written[1] - written[0]) * 8)
        if x.shape[0]:
            for i in range(self.occurrence_start[root, range_],
                           self.occurrence_start[root, range_ + 1]):
                first = min(first, <int64_t>self.occurrences[i].row)
                last = max(last, <int64_t>self.occurrences[i].row
                           + self.blocks[self.occurrences[i].block].rows)
            self._add_product(root, range_, &x[0], y)
        written[0], written[1] = max(first, low), min(last, high)

    def multiply(self, int root, const double[::1] x, double[::1] y, int64_t first=0,
                 int64_t last=-1):
        """y = A x on some ranges of rows, for x float64[columns] and y float64[rows]."""
        cdef int64_t p
        last = self._check_arguments(root, y.shape[0], x.shape[0], first, last)
        if y.shape[0] == 0:
            return
        with nogil:
            for p in range(first, last):
                memset(&y[self.bounds[p]], 0, (self.bounds[p + 1] - self.bounds[p]) * 8)
                if x.shape[0]:
                    self._add_product(root, p, &x[0], &y[self.bounds[p]])

    def multiply_choices(self, const double[::1] x, const int64_t[::1] groups,
                         const uint8_t[:, ::1] present, double[::1] out, int64_t first=0,
                         int64_t last=-1):
        """out[groups[s] + i] = row s of A x for the i-th root present in state s, on some ranges of
        rows.

        x: float64[columns]. out: float64[groups[rows]].
        """
        cdef int64_t p, s, root, begin, end
        cdef double[::1] product = np.empty(self._longest_range())
        cdef int64_t[::1] next_row = np.empty(self._longest_range(), np.int64)
        cdef int64_t written[2]
        last = self._check_arguments(0, groups.shape[0] - 1, x.shape[0], first, last)
        with nogil:
            for p in range(first, last):
                begin, end = self.bounds[p], self.bounds[p + 1]
                for s in range(begin, end):
                    next_row[s - begin] = groups[s]
                written[0], written[1] = begin, end
                for root in range(self.roots):
                    self._multiply_range(root, p, x, &product[0], written)
                    scatter(&present[root, 0], begin, end, &product[0], &next_row[0], &out[0])

    def sweep(self, double[::1] x, const double[::1] constant, const double[::1] divisor,
              groups: Int64s | None, present: Masks | None, bint greatest, bint upper,
              double rounding_error, double underflow, const int32_t[::1] order,
              int repetitions) -> float:
        """Tighten bounds on the solution of x = opt(constant + A x / divisor), in place, range by
        range.

        Each range uses the new values of the ranges before it. Lower bounds only rise, and upper
        bounds only fall.

        Args:
            x: float64[rows], lower bounds, or upper bounds if `upper`.
            constant: float64 per row. divisor: float64 per row, or empty for 1.
            groups, present: as in `multiply_choices`; None where states have one row.
            greatest: maximum instead of minimum.
            rounding_error, underflow: relative and absolute error of a step, by which new values
                are moved outwards.
            order: int32, the ranges in the order of their treatment.
            repetitions: how often a range is repeated at most, until it hardly changes.
        Returns:
            The greatest relative change.
        """
        cdef int64_t p, i, s, root, begin, end
        cdef bint grouped = groups is not None
        cdef const int64_t[::1] row_start = groups if grouped else np.empty(0, np.int64)
        cdef const uint8_t[:, ::1] bits = present if grouped else np.empty((0, 0), np.uint8)
        cdef double[::1] product = np.empty(self._longest_range())
        cdef double[::1] best = np.empty(self._longest_range())
        cdef int64_t[::1] next_row = np.empty(self._longest_range(), np.int64)
        cdef double change, greatest_change = 0
        self._check_arguments(0, x.shape[0], x.shape[0], 0, -1)
        with nogil:
            for i in range(order.shape[0] if self.rows else 0):
                p = order[i]
                begin, end = self.bounds[p], self.bounds[p + 1]
                for _ in range(repetitions):
                    for s in range(begin, end):
                        best[s - begin] = -INFINITY if greatest else INFINITY
                        next_row[s - begin] = row_start[s] if grouped else s
                    for root in range(self.roots):
                        memset(&product[0], 0, (end - begin) * 8)
                        self._add_product(root, p, &x[0], &product[0])
                        s = _next_present(&bits[root, 0], begin, end) if grouped else begin
                        while s < end:
                            _improve_best(product[s - begin], next_row[s - begin], constant,
                                          divisor, greatest, &best[s - begin])
                            next_row[s - begin] += 1
                            s = _next_present(&bits[root, 0], s + 1, end) if grouped else s + 1
                    change = _tighten(&x[begin], &best[0], end - begin, upper, rounding_error,
                                      underflow)
                    greatest_change = max(greatest_change, change)
                    if change <= 4 * rounding_error:
                        break
        return greatest_change

    def range_dependencies(self) -> Bools:
        """Which ranges of x the rows of each range may read, for a square matrix: bool[ranges,
        ranges].
        """
        cdef int64_t p, root, i, low, high, shift
        cdef Occurrence* occurrence
        cdef Block* block
        changes = np.zeros((self.ranges, self.ranges + 1), np.int32)
        range_bounds = np.asarray(self.range_bounds)
        all_columns_read = np.empty((self.occurrence_count, 2), np.int64)
        cdef int64_t[:, ::1] columns_read = all_columns_read
        ranges_of = np.empty(self.occurrence_count, np.int64)
        cdef int64_t[::1] range_of = ranges_of
        for root in range(self.roots):
            for p in range(self.ranges):
                for i in range(self.occurrence_start[root, p], self.occurrence_start[root, p + 1]):
                    occurrence = &self.occurrences[i]
                    block = &self.blocks[occurrence.block]
                    low, high = occurrence.col, <int64_t>occurrence.col + block.cols
                    if block.runs == 1:          # a run's columns go with its rows
                        shift = low - <int64_t>occurrence.row
                        low = max(low, self.range_bounds[p] + shift)
                        high = min(high, self.range_bounds[p + 1] + shift)
                    range_of[i], columns_read[i, 0], columns_read[i, 1] = p, low, high - 1
        first, last = np.searchsorted(range_bounds, all_columns_read, side="right").T - 1
        np.add.at(changes, (ranges_of, first), 1)
        np.add.at(changes, (ranges_of, last + 1), -1)
        return np.cumsum(changes, axis=1)[:, : self.ranges] > 0

    def count_entries(self, int root, int32_t[::1] counts):
        """counts[i] += number of entries in row i, for counts int32[rows]."""
        cdef int64_t i, p
        cdef Occurrence* occurrence
        cdef Block* block
        self._check_arguments(root, counts.shape[0], self.columns, 0, -1)
        with nogil:
            for p in range(self.ranges):
                for i in range(self.occurrence_start[root, p], self.occurrence_start[root, p + 1]):
                    occurrence = &self.occurrences[i]
                    if occurrence.row < self.bounds[p]:
                        continue
                    block = &self.blocks[occurrence.block]
                    count(self._runs(block), &counts[0] + occurrence.row)

    def count_choice_entries(self, const int64_t[::1] groups, const uint8_t[:, ::1] present,
                             int64_t[::1] counts) -> bool:
        """counts[r] = number of entries of row r, with rows as in `multiply_choices`.

        counts: int64[groups[rows]]. Returns False if a state has entries in a root that is not
        present in it.
        """
        cdef int64_t s, root, n = self.rows
        cdef bint complete = True
        cdef int64_t[::1] next_row = np.array(groups[:n])
        cdef int32_t[::1] entries = np.empty(n, np.int32)
        for root in range(self.roots):
            entries[:] = 0
            self.count_entries(root, entries)
            with nogil:
                s = _next_present(&present[root, 0], 0, n) if n else 0
                while s < n:
                    counts[next_row[s]] = entries[s]
                    entries[s] = 0
                    next_row[s] += 1
                    s = _next_present(&present[root, 0], s + 1, n)
                for s in range(n):
                    complete = complete and entries[s] == 0
        return complete

    def fill_rows(self, int root, int64_t[::1] next_entry, int32_t[::1] indices, double[::1] data):
        """Append the columns and values of each row to arrays; columns ascend if the partition is
        `ordered`.

        next_entry: int64[rows], where to write each row's next entry; it is advanced.
        """
        cdef int64_t i
        cdef Occurrence* occurrence
        cdef Block* block
        self._check_arguments(root, next_entry.shape[0], self.columns, 0, -1)
        if indices.shape[0] == 0:
            return
        with nogil:
            for i in range(self.occurrence_start[root, 0],
                           self.occurrence_start[root, self.ranges]):
                occurrence = &self.occurrences[i]
                block = &self.blocks[occurrence.block]
                fill(self._runs(block), &self.values[0], &next_entry[0] + occurrence.row,
                     occurrence.col, &indices[0], &data[0])

    def single_columns(self, int root, int32_t[::1] out):
        """out[i] = the column of the only entry of row i, for rows with one entry; out int32[rows].
        """
        cdef int64_t i
        cdef Occurrence* occurrence
        cdef Block* block
        self._check_arguments(root, out.shape[0], self.columns, 0, -1)
        with nogil:
            for i in range(self.occurrence_start[root, 0],
                           self.occurrence_start[root, self.ranges]):
                occurrence = &self.occurrences[i]
                block = &self.blocks[occurrence.block]
                columns(self._runs(block), occurrence.col, &out[0] + occurrence.row)
