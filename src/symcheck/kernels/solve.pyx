# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Bounds for x = A x + b with non-negative A and b, component by component, rounded outwards.

Values are pairs (lower, upper), side by side. A sum of k products of non-negative doubles is off by less than
(k+1) 2^-53 relative, in any order; every row is therefore widened by (k + SLACK) 2^-53, which also pays for the division by
1 - (self-loop), and by TINY for underflow. So each update maps true bounds to true bounds, whatever the machine rounds.
"""

import numpy as np

from libc.float cimport DBL_MAX, DBL_MIN
from libc.math cimport fabs, log, INFINITY
from libc.stdint cimport int32_t, int64_t

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307

cdef int64_t FEW = 20000      # states of a block with choices that is swept a little at once
cdef int64_t EFFORT = 50000   # entries that such sweeps go over

NONE, MIN, MAX = 0, 1, 2


cdef class Block:
    """The equations of some states, copied together, with self-loops divided out: x_s = opt over rows of (b + sum a x).

    Local rows r of local state s: group[s] to group[s+1]; rows that only loop on s are left out. `exit` is the mass (of the
    scaled row) that leaves the block. `x` are the bounds, `choice` the local row that gave the bound a strategy can attain.
    """

    cdef public int64_t n, rows, entries
    cdef public int mode
    cdef public int64_t[::1] row_ptr, group, row_id, choice
    cdef public int32_t[::1] idx
    cdef public double[::1] val, bl, bh, exit
    cdef public double[:, ::1] x
    cdef public bint open_, grouped

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

    cdef load(self, System system, const int32_t[::1] states, double[:, ::1] x):
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

    cdef void copy(self, System system, const int32_t[::1] states, double[:, ::1] x, bint grouped) noexcept nogil:
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
                self.bl[rows] = lo - fabs(lo) * terms * U
                self.bh[rows] = hi + fabs(hi) * terms * U
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

    cdef void set_choices(self) noexcept nogil:
        """A choice for every state, for where no sweep improves on the start."""
        cdef int64_t i, r, k, best
        cdef double total, least
        for i in range(self.n):
            best = self.group[i]
            least = INFINITY
            for r in range(self.group[i], self.group[i + 1]):
                total = self.bh[r]
                for k in range(self.row_ptr[r], self.row_ptr[r + 1]):
                    total = total + self.val[k] * self.x[self.idx[k], 1]
                if self.mode == 2:
                    total = -total
                if total < least:
                    least = total
                    best = r
            if self.choice[i] < 0:
                self.choice[i] = best

    cdef double pair_sweep(self, bint relative, bint backwards) noexcept nogil:
        """One Gauss-Seidel sweep over both bounds; returns the greatest (relative) width that is left."""
        if self.mode == 0:
            return self.chain_sweep(relative, backwards)
        return self.choice_sweep(relative, backwards)

    cdef double chain_sweep(self, bint relative, bint backwards) noexcept nogil:
        cdef int64_t i, j, k, n = self.n, end
        cdef double lo, hi, margin, width, widest = 0.0, a
        cdef double* x = &self.x[0, 0]
        cdef double* y
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.row_ptr[0]
        cdef const double* bl = &self.bl[0]
        cdef const double* bh = &self.bh[0]
        for j in range(n):
            i = n - 1 - j if backwards else j
            lo = bl[i]
            hi = bh[i]
            end = ptr[i + 1]
            for k in range(ptr[i], end):
                a = val[k]
                y = x + 2 * <int64_t>idx[k]
                lo = lo + a * y[0]
                hi = hi + a * y[1]
            margin = (end - ptr[i] + SLACK) * U
            lo = lo - lo * margin
            hi = hi + (hi * margin + (TINY if hi > 0.0 else 0.0))
            y = x + 2 * i
            if lo > y[0]:
                y[0] = lo
            if hi < y[1]:
                y[1] = hi
            width = y[1] - y[0]
            if relative:
                # width / upper > widest, without a division where it does not matter
                if width > widest * y[1]:
                    width = width / (y[1] if y[1] > 1e-300 else 1e-300)
                    if width > widest:
                        widest = width
            elif width > widest:
                widest = width
        return widest

    cdef double choice_sweep(self, bint relative, bint backwards) noexcept nogil:
        cdef int64_t i, j, r, k, n = self.n, first, last
        cdef double lo, hi, best_lo, best_hi, margin, width, widest = 0.0, a
        cdef int64_t arg_lo, arg_hi
        cdef bint most = self.mode == 2
        cdef double* x = &self.x[0, 0]
        cdef double* y
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.row_ptr[0]
        cdef const double* bl = &self.bl[0]
        cdef const double* bh = &self.bh[0]
        for j in range(n):
            i = n - 1 - j if backwards else j
            first = self.group[i]
            last = self.group[i + 1]
            y = x + 2 * i
            if first == last:
                y[0] = 0.0
                y[1] = 0.0
                continue
            best_lo = best_hi = 0.0
            arg_lo = arg_hi = first
            for r in range(first, last):
                lo = bl[r]
                hi = bh[r]
                for k in range(ptr[r], ptr[r + 1]):
                    a = val[k]
                    y = x + 2 * <int64_t>idx[k]
                    lo = lo + a * y[0]
                    hi = hi + a * y[1]
                margin = (ptr[r + 1] - ptr[r] + SLACK) * U
                lo = lo - lo * margin
                hi = hi + (hi * margin + (TINY if hi > 0.0 else 0.0))
                if r == first or (lo > best_lo if most else lo < best_lo):
                    best_lo = lo
                    arg_lo = r
                if r == first or (hi > best_hi if most else hi < best_hi):
                    best_hi = hi
                    arg_hi = r
            y = x + 2 * i
            if best_lo > y[0]:
                y[0] = best_lo
                if most:
                    self.choice[i] = arg_lo
            if best_hi < y[1]:
                y[1] = best_hi
                if not most:
                    self.choice[i] = arg_hi
            width = y[1] - y[0]
            if relative:
                if width > widest * y[1]:
                    width = width / (y[1] if y[1] > 1e-300 else 1e-300)
                    if width > widest:
                        widest = width
            elif width > widest:
                widest = width
        return widest

    cdef double low_sweep(self, bint relative, bint backwards) noexcept nogil:
        """One Gauss-Seidel sweep over the lower bounds; the differences go to `x[:, 1]`. Returns the greatest change."""
        cdef int64_t i, j, r, k, n = self.n, arg
        cdef double lo, best, change, most = 0.0
        cdef double[:, ::1] x = self.x
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.row_ptr[0]
        for j in range(n):
            i = n - 1 - j if backwards else j
            best = 0.0
            arg = -1
            for r in range(self.group[i], self.group[i + 1]):
                lo = self.bl[r]
                for k in range(ptr[r], ptr[r + 1]):
                    lo = lo + val[k] * x[idx[k], 0]
                lo = lo - lo * ((ptr[r + 1] - ptr[r] + SLACK) * U)
                if arg < 0 or (lo > best if self.mode == 2 else lo < best):
                    best = lo
                    arg = r
            change = best - x[i, 0]
            if change > 0.0:
                x[i, 0] = best
                if self.mode == 2:
                    self.choice[i] = arg
            else:
                change = 0.0
            x[i, 1] = change
            if relative and change > 0.0:
                change = change / (best if best > 1e-300 else 1e-300)
            if change > most:
                most = change
        return most

    cdef int high_sweep(self, double[::1] high) noexcept nogil:
        """One Gauss-Seidel sweep over candidate upper bounds. 1: nothing rose, so they are bounds; -1: refuted; 0: neither."""
        cdef int64_t i, r, k, n = self.n, arg
        cdef double hi, best
        cdef int verdict = 1
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.row_ptr[0]
        for i in range(n):
            best = 0.0
            arg = -1
            for r in range(self.group[i], self.group[i + 1]):
                hi = self.bh[r]
                for k in range(ptr[r], ptr[r + 1]):
                    hi = hi + val[k] * high[idx[k]]
                hi = hi + (hi * ((ptr[r + 1] - ptr[r] + SLACK) * U) + (TINY if hi > 0.0 else 0.0))
                if arg < 0 or (hi > best if self.mode == 2 else hi < best):
                    best = hi
                    arg = r
            if best > high[i]:
                verdict = 0
            if best < self.x[i, 0]:
                return -1
            high[i] = best
            if self.mode == 1:
                self.choice[i] = arg
        return verdict

    cpdef tuple interval(self, double goal, bint relative, int64_t budget):
        """Sweep both bounds (`x` holds true ones) until they are `goal` apart: (done, sweeps, widest).

        Gives up early when the rate of convergence says that the budget will not do.
        """
        cdef int64_t sweeps = 0
        cdef double widest = INFINITY, before = INFINITY, rate
        cdef bint done = False
        with nogil:
            if self.mode != 0:
                self.set_choices()
            while sweeps < budget:
                # Three sweeps in the order of the search, then one against it.
                widest = self.pair_sweep(relative, sweeps % 4 == 3)
                sweeps += 1
                if widest <= goal:
                    done = True
                    break
                if sweeps % 32 == 0:
                    if sweeps >= 64 and before < INFINITY:
                        rate = widest / before
                        if rate >= 0.999999 or sweeps + 32.0 * log(goal / widest) / log(rate) > 4.0 * budget:
                            break
                    before = widest
        return done, sweeps, widest

    cpdef tuple optimistic(self, double goal, bint relative, int64_t budget, bint fresh=True):
        """Lower bounds by sweeps from 0 (if `fresh`); then a guess at upper bounds, verified: (done, sweeps, widest).

        Optimistic value iteration (Hartmanns & Kaminski 2020), with the guess scaled by the observed rate.
        """
        cdef int64_t sweeps = 0, tries, i, last = 0
        cdef double change = INFINITY, before = INFINITY, rate = 0.5, factor, tolerance = goal, widest = INFINITY
        cdef int verdict
        cdef bint done = False
        cdef double[::1] high = np.empty(self.n)
        with nogil:
            if fresh:
                for i in range(self.n):
                    self.x[i, 0] = 0.0
            while sweeps < budget:
                before = change
                change = self.low_sweep(relative, False)
                sweeps += 1
                if change > 0.0 and before > 0.0 and before < INFINITY:
                    rate = 0.7 * rate + 0.3 * (change / before)
                if rate > 0.9999999:
                    rate = 0.9999999
                factor = 1.0 / (1.0 - rate)
                if change * factor > tolerance and sweeps - last < 1000:
                    continue
                # Guess: what is still to come is about change/(1-rate); a little more makes it a bound in one or two sweeps.
                last = sweeps
                for i in range(self.n):
                    high[i] = self.x[i, 0] * (1.0 + 0.25 * goal) + 2.0 * factor * self.x[i, 1]
                    if not relative:
                        high[i] = high[i] + 0.25 * goal
                verdict = 0
                # The slack of the guess comes from where something is gained, and takes sweeps to spread as values did.
                for tries in range(30 + sweeps // 2):
                    verdict = self.high_sweep(high)
                    sweeps += 1
                    if verdict != 0:
                        break
                if verdict == 1:
                    for i in range(self.n):
                        self.x[i, 1] = high[i]
                    widest = INFINITY
                    while sweeps < budget:
                        widest = self.pair_sweep(relative, False)
                        sweeps += 1
                        if widest <= goal:
                            done = True
                            break
                    break
                tolerance = tolerance * 0.2
                if tolerance < 1e-17:
                    break
        return done, sweeps, widest

    cpdef bint eliminate(self):
        """Solve a block without choices by elimination without subtraction (Grassmann, Taksar & Heyman 1985).

        In a full matrix, for few states; the error is bounded as in kernels/eliminate. False where some state cannot leave, or
        where numbers leave the range of normal doubles: sums that are normal have lost no more than a rounding.
        """
        cdef int64_t n = self.n, i, j, k, e
        cdef double[:, ::1] m = np.zeros((n, n))
        cdef double[::1] v = np.empty(n)
        cdef double[::1] s = np.empty(n)
        cdef double g, error
        cdef bint lost = False
        cdef int64_t updates = 0
        cdef long double total, lo, hi
        with nogil:
            for i in range(n):
                v[i] = self.exit[i]
                for e in range(self.row_ptr[i], self.row_ptr[i + 1]):
                    m[i, self.idx[e]] += self.val[e]
            for k in range(n - 1, -1, -1):
                total = v[k]
                for j in range(k):
                    total = total + m[k, j]
                if total <= 0.0:
                    with gil:
                        return False
                s[k] = <double>total
                for i in range(k):
                    if m[i, k] > 0.0:
                        g = m[i, k] / s[k]
                        updates += 1
                        for j in range(k):
                            m[i, j] += g * m[k, j]
                            if m[i, j] < DBL_MIN and m[k, j] > 0.0:
                                lost = True
                        v[i] += g * v[k]
                        self.bl[i] += g * self.bl[k]
                        self.bh[i] += g * self.bh[k]
                        if g < DBL_MIN or (v[i] < DBL_MIN and v[k] > 0.0) or (self.bl[i] < DBL_MIN and self.bl[k] > 0.0):
                            lost = True
            error = (10.0 * updates + 10.0 * n + 20.0) * U
            for k in range(n):
                lo = self.bl[k]
                hi = self.bh[k]
                for j in range(k):
                    lo = lo + <long double>m[k, j] * self.x[j, 0]
                    hi = hi + <long double>m[k, j] * self.x[j, 1]
                self.x[k, 0] = <double>(lo / s[k])
                self.x[k, 1] = <double>(hi / s[k])
                if (lo > 0.0 and self.x[k, 0] < DBL_MIN) or (self.x[k, 1] > DBL_MAX and hi <= DBL_MAX):
                    lost = True
            for k in range(n):
                self.x[k, 0] = self.x[k, 0] * (1.0 - error)
                self.x[k, 1] = self.x[k, 1] * (1.0 + error) + (TINY if self.x[k, 1] > 0.0 else 0.0)
        return not lost


cdef class System:
    """The whole problem: compressed rows, constants, and mass that leaves the unknowns, per row."""

    cdef public const int64_t[::1] indptr, groups
    cdef public const int32_t[::1] indices
    cdef public const double[::1] data, bl, bh, exit
    cdef public int mode
    cdef public int32_t[::1] place  # of states in the block being loaded; none until there is one
    cdef public int64_t n

    def __init__(self, indptr, indices, data, groups, lower, upper, exit, int mode):
        self.indptr, self.indices, self.data = indptr, indices, data
        self.bl, self.bh, self.exit = lower, upper, exit
        self.mode = mode
        self.n = indptr.shape[0] - 1 if groups is None else groups.shape[0] - 1
        self.groups = np.zeros(1, dtype=np.int64) if groups is None else groups
        self.place = None

    def block(self, const int32_t[::1] states, double[:, ::1] x):
        """The block of `states`, the others' bounds known."""
        cdef Block block = Block()
        block.load(self, states, x)
        return block

    def store(self, Block block, const int32_t[::1] states, double[:, ::1] x, int64_t[::1] strategy):
        """Write a block's bounds and choices back."""
        block.store(states, x, strategy)

    cdef bint single(self, int64_t s, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil:
        """Bounds of a state that is a component of its own. False where it is infinite."""
        cdef int64_t first = s if self.mode == 0 else self.groups[s]
        cdef int64_t last = s + 1 if self.mode == 0 else self.groups[s + 1]
        cdef int64_t r, k, best = -1
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        cdef const int64_t* indptr = &self.indptr[0]
        cdef double* y
        cdef double* base = &x[0, 0]
        cdef double lo, hi, loop, margin, best_lo = 0.0, best_hi = 0.0, a
        cdef int32_t c
        cdef long double total
        cdef bint infinite = False
        for r in range(first, last):
            lo = self.bl[r]
            hi = self.bh[r]
            loop = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                c = indices[k]
                a = data[k]
                if c == s:
                    loop = loop + a
                else:
                    y = base + 2 * <int64_t>c
                    lo = lo + a * y[0]
                    hi = hi + a * y[1]
            if loop > 0.0:
                total = self.exit[r]
                for k in range(indptr[r], indptr[r + 1]):
                    if indices[k] != s:
                        total = total + data[k]
                if total <= 0.0:
                    if hi > 0.0:
                        infinite = infinite or self.mode != 1
                    continue
                lo = <double>(lo / total)
                hi = <double>(hi / total)
            margin = (indptr[r + 1] - indptr[r] + SLACK) * U
            lo = lo - lo * margin
            hi = hi + (hi * margin + (TINY if hi > 0.0 else 0.0))
            if best < 0:
                best = r
                best_lo = lo
                best_hi = hi
            elif self.mode == 2:
                if lo > best_lo:
                    best_lo = lo
                    best = r
                if hi > best_hi:
                    best_hi = hi
            else:
                if hi < best_hi:
                    best_hi = hi
                    best = r
                if lo < best_lo:
                    best_lo = lo
        if infinite and (best < 0 or self.mode == 2):
            best_lo = best_hi = INFINITY
        x[s, 0] = best_lo
        x[s, 1] = best_hi
        if self.mode != 0:
            strategy[s] = best
        return not infinite

    def sweep_acyclic(self, double[:, ::1] x, int64_t[::1] strategy, bint descending):
        """All states in index order, where every edge but loops leads to states that come earlier in that order."""
        cdef int64_t i
        with nogil:
            for i in range(self.n):
                self.single(self.n - 1 - i if descending else i, x, strategy)

    def advance(self, const int32_t[::1] order, const int64_t[::1] start, int64_t component, double[:, ::1] x,
                int64_t[::1] strategy, const int32_t[::1] deep, double share, bint relative, bint probability, int64_t small,
                int64_t[::1] counters):
        """Solve components from number `component` on, as far as cheap means go; returns the first that needs more.

        Single states, blocks without choices of up to `small` states, and blocks with choices that a few sweeps (hundreds,
        where they are small) solve. The width wanted of component c is deep[c] * share.
        counters: [single, eliminated, swept, sweeps, largest eliminated, largest swept].
        """
        cdef int64_t count = start.shape[0] - 1, size, sweeps
        cdef double goal
        cdef Block block = Block()
        cdef bint done
        while component < count:
            with nogil:
                while component < count and start[component + 1] - start[component] == 1:
                    self.single(order[start[component]], x, strategy)
                    counters[0] += 1
                    component += 1
            if component == count:
                break
            states = order[start[component]: start[component + 1]]
            size = states.shape[0]
            if size > (small if self.mode == 0 else FEW):
                break
            block.load(self, states, x)
            if not block.open_ or (block.mode == 0 and size > small):
                break
            if block.mode == 0:
                done = block.eliminate()
                counters[1] += 1
                counters[4] = max(counters[4], size)
            else:
                goal = deep[component] * share
                sweeps = min(400, max(24, EFFORT // (block.entries + block.n + 1)))
                if probability:
                    block.principle()
                    done, sweeps, _ = block.interval(goal, relative, sweeps)
                else:
                    done, sweeps, _ = block.optimistic(goal, relative, sweeps)
                counters[3] += sweeps
                counters[2] += done
                counters[5] = max(counters[5], size if done else 0)
            if not done:
                break
            with nogil:
                block.store(states, x, strategy)
            component += 1
        return component
