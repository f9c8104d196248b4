# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""x = A x + b with non-negative A and b: all equations, and those of some states copied together, with known bounds put in.

Values are pairs (lower, upper), side by side. A sum of k products of non-negative doubles is off by less than
(k+1) 2^-53 relative, in any order; every row is therefore widened by (k + SLACK) 2^-53, which also pays for the division by
1 - (self-loop), and by TINY for underflow. So each update maps true bounds to true bounds, whatever the machine rounds.
"""

import numpy as np

from libc.math cimport fabs, INFINITY
from libc.stdint cimport int32_t, int64_t

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307


cdef class Equations:
    """The whole problem: compressed rows, constants, and mass that leaves the unknowns, per row."""

    def __init__(self, indptr, indices, data, groups, lower, upper, exit, int mode):
        self.indptr, self.indices, self.data = indptr, indices, data
        self.bl, self.bh, self.exit = lower, upper, exit
        self.mode = mode
        self.n = indptr.shape[0] - 1 if groups is None else groups.shape[0] - 1
        self.groups = np.zeros(1, dtype=np.int64) if groups is None else groups
        self.place = None


cdef class Part:
    """The equations of some states, copied together, with self-loops divided out: x_s = opt over rows of (b + sum a x).

    Local rows r of local state s: group[s] to group[s+1]; rows that only loop on s are left out. `exit` is the mass (of the
    scaled row) that leaves the block. `x` are the bounds, `choice` the local row that gave the bound a strategy can attain.
    """

    def __cinit__(self):
        self.n = self.rows = self.entries = 0
        self.reserve(64, 64, 256)

    cdef reserve(self, int64_t n, int64_t rows, int64_t entries):
        if self.group is None or self.group.shape[0] < n + 1:
            n = n + n // 4
            self.group = np.zeros(n + 1, dtype=np.int64)
            self.choice = np.zeros(n, dtype=np.int64)
            self.x = np.zeros((n, 2))
        if self.row_ptr is None or self.row_ptr.shape[0] < rows + 1:
            rows = rows + rows // 4
            self.row_ptr = np.zeros(rows + 1, dtype=np.int64)
            self.row_id = np.zeros(rows, dtype=np.int64)
            self.bl = np.zeros(rows)
            self.bh = np.zeros(rows)
            self.exit = np.zeros(rows)
        if self.idx is None or self.idx.shape[0] < entries:
            entries = entries + entries // 4
            self.idx = np.zeros(entries, dtype=np.int32)
            self.val = np.zeros(entries)

    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x):
        """Copy the equations of `states`; the bounds in `x` of all other states are taken as known."""
        cdef int64_t n = states.shape[0], i, r, k, rows = 0, entries = 0
        cdef int32_t[::1] place = system.place
        cdef const int64_t[::1] groups = system.groups
        cdef const int64_t[::1] indptr = system.indptr
        cdef bint grouped = system.mode != 0
        if place is None:
            place = system.place = np.full(system.n, -1, dtype=np.int32)
        with nogil:
            for i in range(n):
                place[states[i]] = <int32_t>i
                if grouped:
                    rows += groups[states[i] + 1] - groups[states[i]]
                    entries += indptr[groups[states[i] + 1]] - indptr[groups[states[i]]]
                else:
                    rows += 1
                    entries += indptr[states[i] + 1] - indptr[states[i]]
        self.reserve(n, rows, entries)
        self.n = n
        self.mode = system.mode
        self.grouped = grouped
        with nogil:
            self.copy(system, states, x, grouped)
            if grouped and self.forced():
                self.mode = 0
            for i in range(n):
                place[states[i]] = -1

    cdef bint forced(self) noexcept nogil:
        """Whether every state has one row: the block is a chain, and the choices are known."""
        cdef int64_t i
        if self.rows != self.n:
            return False
        for i in range(self.n):
            if self.group[i + 1] != i + 1:
                return False
        for i in range(self.n):
            self.choice[i] = i
        return True

    cdef void copy(self, Equations system, const int32_t[::1] states, double[:, ::1] x, bint grouped) noexcept nogil:
        cdef const int32_t[::1] indices = system.indices
        cdef const double[::1] data = system.data
        cdef int32_t[::1] place = system.place
        cdef int64_t i, r, k, s, first, last, rows = 0, entries = 0, begin
        cdef int32_t c
        cdef double lo, hi, scale, loop, terms
        cdef long double total, leaving
        self.open_ = False
        self.row_ptr[0] = 0
        for i in range(states.shape[0]):
            s = states[i]
            self.group[i] = rows
            self.choice[i] = -1
            first = system.groups[s] if grouped else s
            last = system.groups[s + 1] if grouped else s + 1
            for r in range(first, last):
                begin = entries
                lo = system.bl[r]
                hi = system.bh[r]
                leaving = system.exit[r]
                total = 0.0
                loop = 0.0
                terms = SLACK
                for k in range(system.indptr[r], system.indptr[r + 1]):
                    c = place[indices[k]]
                    if c == i:
                        loop = loop + data[k]
                    elif c >= 0:
                        self.idx[entries] = c
                        self.val[entries] = data[k]
                        entries += 1
                        total = total + data[k]
                    else:
                        lo = lo + data[k] * x[indices[k], 0]
                        hi = hi + data[k] * x[indices[k], 1]
                        leaving = leaving + data[k]
                        terms = terms + 1.0
                total = total + leaving
                if total <= 0.0:
                    # The row only loops on its state and never leaves: its value is infinite, or it is of no use.
                    entries = begin
                    if system.mode == 1 or (hi == 0.0 and system.mode == 2):
                        continue
                    if hi > 0.0:
                        lo = hi = INFINITY
                if loop > 0.0 and total > 0.0:
                    scale = <double>(1.0 / total)
                    for k in range(begin, entries):
                        self.val[k] = self.val[k] * scale
                    lo = lo * scale
                    hi = hi * scale
                    leaving = leaving / total
                if leaving > 0.0:
                    self.open_ = True
                self.bl[rows] = lo - fabs(lo) * terms * U if lo < INFINITY else lo
                self.bh[rows] = hi + fabs(hi) * terms * U + (TINY if terms > SLACK and hi != 0.0 else 0.0)
                self.exit[rows] = <double>leaving
                self.row_id[rows] = r
                rows += 1
                self.row_ptr[rows] = entries
        self.group[states.shape[0]] = rows
        self.rows = rows
        self.entries = entries

    cdef void store(self, const int32_t[::1] states, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil:
        cdef int64_t i
        for i in range(self.n):
            x[states[i], 0] = self.x[i, 0]
            x[states[i], 1] = self.x[i, 1]
            if self.grouped and self.choice[i] >= 0:
                strategy[states[i]] = self.row_id[self.choice[i]]

    cpdef bint principle(self):
        """Start from the least and greatest value on leaving (probabilities only). False where nothing leaves.

        What leaves surely has an average of the values b/exit on leaving: the maximum principle.
        """
        cdef int64_t r, i
        cdef double least = INFINITY, most = 0.0, low, high
        with nogil:
            for r in range(self.rows):
                if self.exit[r] > 0.0:
                    low = self.bl[r] / self.exit[r]
                    high = self.bh[r] / self.exit[r]
                    if low < least:
                        least = low
                    if high > most:
                        most = high
            least = least * (1.0 - SLACK * U)
            most = most * (1.0 + SLACK * U)
            if least > 1.0:
                least = 0.0
            if most > 1.0:
                most = 1.0
            for i in range(self.n):
                self.x[i, 0] = least
                self.x[i, 1] = most
        return self.open_
