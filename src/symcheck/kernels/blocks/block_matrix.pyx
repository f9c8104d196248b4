# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products with a matrix that is stored as blocks, and its compressed rows: both stamp the blocks at their places."""
from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t, uint8_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.blocks.block_operations cimport (
    clipped_small, clipped_wide, columns_small, columns_wide, count_small, count_wide, diagonal_small, diagonal_wide, fill_small,
    fill_wide, improve, multiply_small, multiply_wide, scatter, transposed_small, transposed_wide,
)
from symcheck.kernels.blocks.block_partition cimport Block, Cut, Place

import numpy as np

__all__ = ["Blocks"]


cdef inline int64_t _next(const uint8_t* present, int64_t s, int64_t end) noexcept nogil:
    """The first state from s on whose bit is set (bit s % 8 of byte s // 8), or `end`."""
    while s < end:
        if (s & 7) == 0 and present[s >> 3] == 0:
            s += 8
        elif (present[s >> 3] >> (s & 7)) & 1:
            return s
        else:
            s += 1
    return end


cdef inline void _better(double value, int64_t row, const double[::1] constant, const double[::1] divisor, bint greatest,
                         double* best) noexcept nogil:
    if divisor.shape[0]:
        value /= divisor[row]
    value += constant[row]
    if (value > best[0]) if greatest else (value < best[0]):
        best[0] = value


cdef double _take(double* x, const double* found, int64_t n, bint upper, double slip) noexcept nogil:
    """Move bounds to new values, rounded outwards, where these are tighter; returns the greatest relative change."""
    cdef int64_t i
    cdef double value, most = 0
    for i in range(n):
        value = found[i]
        if upper:
            value = value * (1 + slip) + 1e-307 if value > 0 else 0
            if value < x[i]:
                most = max(most, 1 - value / x[i])
                x[i] = value
        else:
            value = value * (1 - slip)
            if value > x[i]:
                most = max(most, 1 - x[i] / value)
                x[i] = value
    return most


cdef class Blocks(Cut):
    """What can be done with the blocks. Lengths of arrays are checked; products release the interpreter lock."""

    cdef void _add(self, int64_t root, int64_t part, const double* x, double* y) noexcept nogil:
        """y += A x on the rows of a part; y begins with the part's first row."""
        cdef int64_t i, low = self.bounds[part], high = self.bounds[part + 1]
        cdef Place* place
        cdef Block* block
        cdef const double* values = &self.values[0]
        cdef double* base = y - low
        for i in range(self.starts[root, part], self.starts[root, part + 1]):
            place = &self.places[i]
            block = &self.blocks[place.block]
            if place.row >= low and place.row + block.rows <= high:
                if block.wide:
                    multiply_wide(self.wide + block.start, block.runs, values, x + place.col, base + place.row)
                else:
                    multiply_small(self.small + block.start, block.runs, values, x + place.col, base + place.row)
            elif block.wide:
                clipped_wide(self.wide + block.start, block.runs, values, x + place.col, base + place.row,
                             low - <int64_t>place.row, high - <int64_t>place.row)
            else:
                clipped_small(self.small + block.start, block.runs, values, x + place.col, base + place.row,
                              low - <int64_t>place.row, high - <int64_t>place.row)

    cdef void _fresh(self, int64_t root, int64_t part, const double[::1] x, double* y, int64_t* used) noexcept nogil:
        """y = A x on the rows of a part, of which only used[0] to used[1] may differ from 0 before; these say so of it after."""
        cdef int64_t i, low = self.bounds[part], high = self.bounds[part + 1], first = high, last = low
        if used[1] > used[0]:
            memset(y + used[0] - low, 0, (used[1] - used[0]) * 8)
        if x.shape[0]:
            for i in range(self.starts[root, part], self.starts[root, part + 1]):
                first = min(first, <int64_t>self.places[i].row)
                last = max(last, <int64_t>self.places[i].row + self.blocks[self.places[i].block].rows)
            self._add(root, part, &x[0], y)
        used[0], used[1] = max(first, low), min(last, high)

    def multiply(self, int root, const double[::1] x, double[::1] y, int64_t first=0, int64_t last=-1):
        """y = A x on the rows of the parts first .. last: x float64[columns], y float64[rows]."""
        cdef int64_t p
        last = self._check(root, y.shape[0], x.shape[0], first, last)
        if y.shape[0] == 0:
            return
        with nogil:
            for p in range(first, last):
                memset(&y[self.bounds[p]], 0, (self.bounds[p + 1] - self.bounds[p]) * 8)
                if x.shape[0]:
                    self._add(root, p, &x[0], &y[self.bounds[p]])

    def multiply_choices(self, const double[::1] x, const int64_t[::1] groups, const uint8_t[:, ::1] present, double[::1] out,
                         int64_t first=0, int64_t last=-1):
        """out[groups[s] + i] = row s of A x for the i-th root that is present in state s, s in the parts first .. last.

        present: per root, bit s % 8 of byte s // 8. out: float64[groups[rows]].
        """
        cdef int64_t p, s, root, begin, end
        cdef double* part
        cdef int64_t* at
        cdef int64_t used[2]
        last = self._check(0, groups.shape[0] - 1, x.shape[0], first, last)
        part = <double*>malloc(self._longest() * 8)
        at = <int64_t*>malloc(self._longest() * 8)
        if part == NULL or at == NULL:
            free(part)
            free(at)
            raise MemoryError
        with nogil:
            for p in range(first, last):
                begin, end = self.bounds[p], self.bounds[p + 1]
                for s in range(begin, end):
                    at[s - begin] = groups[s]
                used[0], used[1] = begin, end
                for root in range(self.roots):
                    self._fresh(root, p, x, part, used)
                    scatter(&present[root, 0], begin, end, part, at, &out[0])
        free(part)
        free(at)

    def optimum(self, const double[::1] x, const double[::1] constant, const int64_t[::1] groups, const uint8_t[:, ::1] present,
                bint greatest, double[::1] out, int64_t first=0, int64_t last=-1):
        """out[s] = least or greatest of constant + A x over the rows of state s (infinite without rows).

        constant: float64[groups[rows]], or empty for none. out: float64[rows].
        """
        cdef int64_t p, s, root, begin, end
        cdef double* part
        cdef int64_t* at
        cdef int64_t used[2]
        cdef double value
        last = self._check(0, out.shape[0], x.shape[0], first, last)
        part = <double*>malloc(self._longest() * 8)
        at = <int64_t*>malloc(self._longest() * 8)
        if part == NULL or at == NULL:
            free(part)
            free(at)
            raise MemoryError
        with nogil:
            for p in range(first, last):
                begin, end = self.bounds[p], self.bounds[p + 1]
                for s in range(begin, end):
                    at[s - begin] = groups[s]
                    out[s] = -INFINITY if greatest else INFINITY
                used[0], used[1] = begin, end
                for root in range(self.roots):
                    self._fresh(root, p, x, part, used)
                    if constant.shape[0] == 0:
                        improve(&present[root, 0], begin, end, part, &out[0], greatest)
                        continue
                    s = _next(&present[root, 0], begin, end)
                    while s < end:
                        value = part[s - begin] + constant[at[s - begin]]
                        at[s - begin] += 1
                        if (value > out[s]) if greatest else (value < out[s]):
                            out[s] = value
                        s = _next(&present[root, 0], s + 1, end)
        free(part)
        free(at)

    def sweep(self, double[::1] x, const double[::1] constant, const double[::1] divisor, groups, present, bint greatest,
              bint upper, double slip, const int32_t[::1] order, int inner):
        """x = opt(constant + A x / divisor) in place, part by part, each with what the parts before it made: bounds for bounds.

        Lower bounds only rise, upper bounds (`upper`) only fall; each new value is moved outwards by the relative error
        `slip`. A part is repeated until it hardly changes, at most `inner` times. divisor: float64 per row, or empty for
        none. groups, present: as in `optimum`; None where rows are states. order: int32, the parts to do, as they are to be
        done. Returns the greatest relative change.
        """
        cdef int64_t p, i, s, root, begin, end
        cdef bint choices = groups is not None
        cdef const int64_t[::1] starts = groups if choices else np.empty(0, np.int64)
        cdef const uint8_t[:, ::1] bits = present if choices else np.empty((0, 0), np.uint8)
        cdef double* part
        cdef double* best
        cdef int64_t* at
        cdef double change, most = 0
        self._check(0, x.shape[0], x.shape[0], 0, -1)
        part = <double*>malloc(self._longest() * 8)
        best = <double*>malloc(self._longest() * 8)
        at = <int64_t*>malloc(self._longest() * 8)
        if part == NULL or best == NULL or at == NULL:
            free(part)
            free(best)
            free(at)
            raise MemoryError
        with nogil:
            for i in range(order.shape[0] if self.rows else 0):
                p = order[i]
                begin, end = self.bounds[p], self.bounds[p + 1]
                for _ in range(inner):
                    for s in range(begin, end):
                        best[s - begin] = -INFINITY if greatest else INFINITY
                        at[s - begin] = starts[s] if choices else s
                    for root in range(self.roots):
                        memset(part, 0, (end - begin) * 8)
                        self._add(root, p, &x[0], part)
                        s = _next(&bits[root, 0], begin, end) if choices else begin
                        while s < end:
                            _better(part[s - begin], at[s - begin], constant, divisor, greatest, &best[s - begin])
                            at[s - begin] += 1
                            s = _next(&bits[root, 0], s + 1, end) if choices else s + 1
                    change = _take(&x[begin], best, end - begin, upper, slip)
                    most = max(most, change)
                    if change <= 4 * slip:
                        break
        free(part)
        free(best)
        free(at)
        return most

    def uses(self):
        """Which parts of x the rows of each part read, at most: bool[parts, parts], for a square matrix."""
        cdef int64_t p, root, i, low, high, shift
        cdef Place* place
        cdef Block* block
        found = np.zeros((self.parts, self.parts + 1), np.int32)
        bounds = np.asarray(self.bounds)
        spans = np.empty((self.places_used, 2), np.int64)
        cdef int64_t[:, ::1] span = spans
        owners = np.empty(self.places_used, np.int64)
        cdef int64_t[::1] owner = owners
        for root in range(self.roots):
            for p in range(self.parts):
                for i in range(self.starts[root, p], self.starts[root, p + 1]):
                    place = &self.places[i]
                    block = &self.blocks[place.block]
                    low, high = place.col, <int64_t>place.col + block.cols
                    if block.runs == 1:          # a run's columns go with its rows
                        shift = low - <int64_t>place.row
                        low = max(low, self.bounds[p] + shift)
                        high = min(high, self.bounds[p + 1] + shift)
                    owner[i], span[i, 0], span[i, 1] = p, low, high - 1
        first, last = np.searchsorted(bounds, spans, side="right").T - 1
        np.add.at(found, (owners, first), 1)
        np.add.at(found, (owners, last + 1), -1)
        return np.cumsum(found, axis=1)[:, : self.parts] > 0

    def multiply_transposed(self, int root, const double[::1] x, double[::1] y):
        """y += x A: x float64[rows], y float64[columns]."""
        cdef int64_t i, p
        cdef Place* place
        cdef Block* block
        self._check(root, x.shape[0], y.shape[0], 0, -1)
        if y.shape[0] == 0 or x.shape[0] == 0:
            return
        with nogil:
            for p in range(self.parts):
                for i in range(self.starts[root, p], self.starts[root, p + 1]):
                    place = &self.places[i]
                    if place.row < self.bounds[p]:      # done where it begins
                        continue
                    block = &self.blocks[place.block]
                    if block.wide:
                        transposed_wide(self.wide + block.start, block.runs, &self.values[0], &x[0] + place.row, &y[0] + place.col)
                    else:
                        transposed_small(self.small + block.start, block.runs, &self.values[0], &x[0] + place.row, &y[0] + place.col)

    def diagonal(self, int root, double[::1] out):
        """out[i] += A[i, i]. out: float64[min(rows, columns)]."""
        cdef int64_t i, p, shift
        cdef Place* place
        cdef Block* block
        self._check(root, self.rows, self.columns, 0, -1)
        if out.shape[0] != min(self.rows, self.columns):
            raise ValueError("the diagonal has another length")
        with nogil:
            for p in range(self.parts):
                for i in range(self.starts[root, p], self.starts[root, p + 1]):
                    place = &self.places[i]
                    if place.row < self.bounds[p]:
                        continue
                    block = &self.blocks[place.block]
                    shift = <int64_t>place.row - <int64_t>place.col      # a run is on the diagonal where col - row = shift
                    if shift > <int64_t>block.cols or -shift > <int64_t>block.rows:
                        continue
                    if block.wide:
                        diagonal_wide(self.wide + block.start, block.runs, &self.values[0], shift, &out[0] + place.row)
                    else:
                        diagonal_small(self.small + block.start, block.runs, &self.values[0], shift, &out[0] + place.row)

    def count_rows(self, int root, int32_t[::1] counts):
        """counts[i] += number of entries in row i."""
        cdef int64_t i, p
        cdef Place* place
        cdef Block* block
        self._check(root, counts.shape[0], self.columns, 0, -1)
        with nogil:
            for p in range(self.parts):
                for i in range(self.starts[root, p], self.starts[root, p + 1]):
                    place = &self.places[i]
                    if place.row < self.bounds[p]:
                        continue
                    block = &self.blocks[place.block]
                    if block.wide:
                        count_wide(self.wide + block.start, block.runs, &counts[0] + place.row)
                    else:
                        count_small(self.small + block.start, block.runs, &counts[0] + place.row)

    def count_choices(self, const int64_t[::1] groups, const uint8_t[:, ::1] present, int64_t[::1] counts):
        """counts[r] = number of entries of row r, numbered as in `multiply_choices`; False if an entry is in no such row."""
        cdef int64_t s, root, n = self.rows
        cdef bint complete = True
        cdef int64_t[::1] at = np.array(groups[:n])
        cdef int32_t[::1] here = np.empty(n, np.int32)
        for root in range(self.roots):
            here[:] = 0
            self.count_rows(root, here)
            with nogil:
                s = _next(&present[root, 0], 0, n) if n else 0
                while s < n:
                    counts[at[s]] = here[s]
                    here[s] = 0
                    at[s] += 1
                    s = _next(&present[root, 0], s + 1, n)
                for s in range(n):
                    complete = complete and here[s] == 0
        return complete

    def fill(self, int root, int64_t[::1] following, int32_t[::1] indices, double[::1] data):
        """Append each row's columns and values at following[row], which moves on; columns ascend (blocks made `ordered`)."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, following.shape[0], self.columns, 0, -1)
        if indices.shape[0] == 0:
            return
        with nogil:
            for i in range(self.starts[root, 0], self.starts[root, self.parts]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    fill_wide(self.wide + block.start, block.runs, &self.values[0], &following[0] + place.row, place.col,
                              &indices[0], &data[0])
                else:
                    fill_small(self.small + block.start, block.runs, &self.values[0], &following[0] + place.row, place.col,
                               &indices[0], &data[0])

    def columns_of(self, int root, int32_t[::1] out):
        """out[i] = the column of the only entry of row i, for the rows that have one."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, out.shape[0], self.columns, 0, -1)
        with nogil:
            for i in range(self.starts[root, 0], self.starts[root, self.parts]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    columns_wide(self.wide + block.start, block.runs, place.col, &out[0] + place.row)
                else:
                    columns_small(self.small + block.start, block.runs, place.col, &out[0] + place.row)
