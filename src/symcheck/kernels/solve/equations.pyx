# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""x = A x + b with non-negative A and b: all equations, and those of some states copied together, with known bounds put in.

Values are pairs (lower, upper), side by side. A sum of k products of non-negative doubles is off by less than
(k+1) 2^-53 relative, in any order; every row is therefore widened by (k + SLACK) 2^-53, which also pays for the division by
1 - (self-loop), and by TINY for underflow. So each update maps true bounds to true bounds, whatever the machine rounds.
"""

import numpy as np

from libc.math cimport fabs, INFINITY
from libc.stdint cimport int32_t, int64_t, INT32_MAX

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307


cdef class Equations:
    """The whole problem: compressed rows, constants, and mass that leaves the matrix, per row.

    lower, upper, exit: float64[rows], or None where they are 0 in every row. unknown: uint8[states], the states whose equations
    these are, where others in the matrix have values that are known; None for all. rates: rows, and their constants, are divided
    by all that leaves their state.
    """

    def __init__(self, indptr, indices, data, groups, lower, upper, exit, int mode, unknown=None, bint rates=False):
        self.indptr, self.indices, self.data = indptr, indices, data
        self.bl, self.bh, self.exit = lower, upper, exit
        self.mode = mode
        self.n = indptr.shape[0] - 1 if groups is None else groups.shape[0] - 1
        self.groups = np.zeros(1, dtype=np.int64) if groups is None else groups
        self.unknown = unknown
        self.rates = rates
        self.place = None

    cdef void put(self, const int32_t[::1] states):
        """Number these states, and no others."""
        cdef int64_t i
        if self.place is None:
            self.place = np.full(self.n, -1, dtype=np.int32)
        for i in range(states.shape[0]):
            self.place[states[i]] = <int32_t>i

    cdef void clear(self, const int32_t[::1] states) noexcept nogil:
        """Take the numbers back."""
        cdef int64_t i
        for i in range(states.shape[0]):
            self.place[states[i]] = -1

    cdef bint useless(self, int64_t state, int64_t row) noexcept nogil:
        """Whether a row only loops on its state, so that its value is infinite (and never the least), or of no use."""
        cdef int64_t k
        if self.mode == 0 or (self.exit is not None and self.exit[row] > 0.0):
            return False
        for k in range(self.indptr[row], self.indptr[row + 1]):
            if self.indices[k] != state and self.data[k] > 0.0:
                return False
        return self.mode == 1 or self.bh is None or self.bh[row] == 0.0


cdef class Part:
    """The equations of some states, copied together, with self-loops divided out: x_s = opt over rows of (b + sum a x).

    Local rows r of local state s: group[s] to group[s+1]; rows that only loop on s are left out. `x` are the bounds, and
    `choice` the row, counted among the state's, that gave the bound a strategy can attain (-1: none yet); there is no memory for
    these two before they are asked for. Starts of rows and groups are int32, or int64 (`wide`) where entries are too many for that.
    """

    cdef reserve(self, bint offsets):
        """Room for these numbers of states, rows and entries, and one more. A view that was never set has no length, and is not None."""
        if self.wide and self.group64.shape[0] <= self.n:
            self.group64 = np.empty(roomy(self.n), dtype=np.int64)
        if self.wide and self.ptr64.shape[0] <= self.rows:
            self.ptr64 = np.empty(roomy(self.rows), dtype=np.int64)
        if not self.wide and self.group32.shape[0] <= self.n:
            self.group32 = np.empty(roomy(self.n), dtype=np.int32)
        if not self.wide and self.ptr32.shape[0] <= self.rows:
            self.ptr32 = np.empty(roomy(self.rows), dtype=np.int32)
        if self.bl.shape[0] <= self.rows:
            self.bl, self.bh = np.empty(roomy(self.rows)), np.empty(roomy(self.rows))
        if self.idx.shape[0] <= self.entries:
            self.idx, self.val = np.empty(roomy(self.entries), dtype=np.int32), np.empty(roomy(self.entries))
        self.offset = np.empty(self.rows, dtype=np.int32) if offsets else None

    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x, bint wide):
        """Copy the equations of `states`; the bounds in `x` of all other states are taken as known."""
        cdef int64_t n = states.shape[0], i, r, s, first, last
        cdef bint grouped = system.mode != 0, useless = False
        self.system, self.states = system, states
        self.n = n
        self.rows = self.entries = 0
        with nogil:
            for i in range(n):
                s = states[i]
                first = system.groups[s] if grouped else s
                last = system.groups[s + 1] if grouped else s + 1
                self.rows += last - first
                self.entries += system.indptr[last] - system.indptr[first]
                for r in range(first, last):
                    useless = useless or system.useless(s, r)
        self.wide = wide or self.entries > INT32_MAX or self.rows > INT32_MAX
        self.mode = system.mode
        self.grouped = grouped
        self.begun = False
        self.reserve(useless)
        system.put(states)
        with nogil:
            if self.wide:
                copy(self, system, x, &self.ptr64[0], &self.group64[0])
            else:
                copy(self, system, x, &self.ptr32[0], &self.group32[0])
            system.clear(states)
            if grouped and self.forced():
                self.mode = 0

    cdef begin(self):
        """Make `x` and `choice`, once per load.

        What leaves surely has an average of the values b/exit on leaving, which is where `x` starts (for probabilities this is
        the maximum principle; rewards have better starts).
        """
        cdef int64_t i
        cdef int32_t choice = 0 if self.mode == 0 else -1
        if self.begun:
            return
        if self.bounds.shape[0] <= self.n:
            self.bounds = np.empty((roomy(self.n), 2))
        if self.grouped and self.picked.shape[0] <= self.n:
            self.picked = np.empty(roomy(self.n), dtype=np.int32)
        for i in range(self.n):
            self.bounds[i, 0] = self.least
            self.bounds[i, 1] = self.most
            if self.grouped:
                self.picked[i] = choice
        self.begun = True

    @property
    def x(self):
        """float64[n, 2]: the bounds, which may be written to as long as they are bounds."""
        self.begin()
        return np.asarray(self.bounds)[: self.n]

    @property
    def choice(self):
        """int32[n]: choices that may be written to; empty where there are none."""
        self.begin()
        return np.asarray(self.picked)[: self.n] if self.grouped else np.empty(0, dtype=np.int32)

    @property
    def row_ptr(self):
        """int32 or int64[rows+1]: where each row begins."""
        return (np.asarray(self.ptr64) if self.wide else np.asarray(self.ptr32))[: self.rows + 1]

    @property
    def group(self):
        """int32 or int64[n+1]: where the rows of each state begin."""
        return (np.asarray(self.group64) if self.wide else np.asarray(self.group32))[: self.n + 1]

    def leaving(self):
        """float64[rows]: the mass that leaves the part, per row, self-loops divided out; made anew each time."""
        cdef double[::1] out = np.empty(self.rows)
        self.system.put(self.states)
        with nogil:
            exits(self, self.system, out)
            self.system.clear(self.states)
        return np.asarray(out)

    def chosen(self, const int32_t[::1] choice):
        """int64[n]: the rows of the whole problem that these choices are (-1 for none)."""
        cdef int64_t i
        cdef int64_t[::1] out = np.empty(self.n, dtype=np.int64)
        for i in range(self.n):
            out[i] = self.original(i, choice[i])
        return np.asarray(out)

    cdef int64_t original(self, int64_t i, int64_t choice) noexcept nogil:
        """The row of the whole problem that is a choice of state i."""
        if choice < 0:
            return -1
        if self.offset is not None:
            choice = self.offset[(self.group64[i] if self.wide else self.group32[i]) + choice]
        return self.system.groups[self.states[i]] + choice

    cdef bint forced(self) noexcept nogil:
        """Whether every state has one row: the block is a chain, and the choices are known."""
        cdef int64_t i
        if self.rows != self.n:
            return False
        for i in range(self.n):
            if (self.group64[i + 1] if self.wide else self.group32[i + 1]) != i + 1:
                return False
        return True

    cdef void store(self, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil:
        """Write bounds and choices back; `strategy` may be empty, where nobody wants it."""
        cdef int64_t i
        cdef bint chosen = self.grouped and strategy.shape[0] > 0
        for i in range(self.n):
            x[self.states[i], 0] = self.bounds[i, 0]
            x[self.states[i], 1] = self.bounds[i, 1]
            if chosen and self.picked[i] >= 0:
                strategy[self.states[i]] = self.original(i, self.picked[i])


cdef inline int64_t roomy(int64_t size) noexcept nogil:
    """A little more for small parts, many of which are loaded one after the other."""
    if size > 100_000:
        return size + 1
    return size + size // 4 if size > 64 else 80


cdef void copy(Part part, Equations system, double[:, ::1] x, index_t* row_ptr, index_t* group) noexcept nogil:
    """The rows, their constants with the known bounds in `x` put in, and the least and the greatest value on leaving."""
    cdef const int32_t[::1] indices = system.indices
    cdef const double[::1] data = system.data
    cdef int32_t[::1] place = system.place
    cdef bint grouped = part.grouped, constants = system.bl is not None
    cdef int64_t i, r, k, s, first, last, rows = 0, entries = 0, begin
    cdef int32_t c
    cdef double lo, hi, scale, loop, terms, least = INFINITY, most = 0.0
    cdef long double total, leaving
    part.open_ = False
    row_ptr[0] = 0
    for i in range(part.n):
        s = part.states[i]
        group[i] = <index_t>rows
        first = system.groups[s] if grouped else s
        last = system.groups[s + 1] if grouped else s + 1
        for r in range(first, last):
            if part.offset is not None and system.useless(s, r):
                continue
            begin = entries
            lo = system.bl[r] if constants else 0.0
            hi = system.bh[r] if constants else 0.0
            leaving = system.exit[r] if system.exit is not None else 0.0
            total = 0.0
            loop = 0.0
            terms = SLACK
            for k in range(system.indptr[r], system.indptr[r + 1]):
                c = place[indices[k]]
                if c == i:
                    loop = loop + data[k]
                elif c >= 0:
                    part.idx[entries] = c
                    part.val[entries] = data[k]
                    entries += 1
                    total = total + data[k]
                else:
                    lo = lo + data[k] * x[indices[k], 0]
                    hi = hi + data[k] * x[indices[k], 1]
                    leaving = leaving + data[k]
                    terms = terms + 1.0
            total = total + leaving
            if total <= 0.0:
                entries = begin
                if hi > 0.0:
                    lo = hi = INFINITY  # what is collected on a loop that nothing leaves
            if (loop > 0.0 or system.rates) and total > 0.0:
                scale = <double>(1.0 / total)
                for k in range(begin, entries):
                    part.val[k] = part.val[k] * scale
                lo = lo * scale
                hi = hi * scale
                leaving = leaving / total
            lo = lo - fabs(lo) * terms * U if lo < INFINITY else lo
            hi = hi + fabs(hi) * terms * U + (TINY if terms > SLACK and hi != 0.0 else 0.0)
            if leaving > 0.0:
                part.open_ = True
                scale = <double>leaving
                if scale > 0.0:
                    least = min(least, lo / scale)
                    most = max(most, hi / scale)
            part.bl[rows] = lo
            part.bh[rows] = hi
            if part.offset is not None:
                part.offset[rows] = <int32_t>(r - first)
            rows += 1
            row_ptr[rows] = <index_t>entries
    group[part.n] = <index_t>rows
    part.rows = rows
    part.entries = entries
    least = least * (1.0 - SLACK * U)
    most = most * (1.0 + SLACK * U)
    part.least = 0.0 if least > 1.0 else least
    part.most = 1.0 if most > 1.0 else most


cdef void exits(Part part, Equations system, double[::1] out) noexcept nogil:
    """The mass that leaves, per row of the part, as `copy` adds it up."""
    cdef int32_t[::1] place = system.place
    cdef bint grouped = part.grouped
    cdef int64_t i, r, k, s, rows = 0
    cdef int32_t c
    cdef long double total, leaving
    cdef bint loop
    for i in range(part.n):
        s = part.states[i]
        for r in range(system.groups[s] if grouped else s, system.groups[s + 1] if grouped else s + 1):
            if part.offset is not None and system.useless(s, r):
                continue
            leaving = system.exit[r] if system.exit is not None else 0.0
            total = 0.0
            loop = False
            for k in range(system.indptr[r], system.indptr[r + 1]):
                c = place[system.indices[k]]
                if c == i:
                    loop = loop or system.data[k] > 0.0
                elif c >= 0:
                    total = total + system.data[k]
                else:
                    leaving = leaving + system.data[k]
            total = total + leaving
            if (loop or system.rates) and total > 0.0:
                leaving = leaving / total
            out[rows] = <double>leaving
            rows += 1
