# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Levels of a budget, one after the other: the values at a level depend on those of lower levels, and on each other through
rows without reward.

Values are pairs (lower, upper), rounded outwards: a row of k terms is off by less than a few k 2^-53 relative, which
`slack` holds per row. A ring of `slots` levels is kept. Rows that lead to states of value 1 only, for certain, have value 1.
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t

cdef double SMALL = 1e-290      # below, products may underflow, which is no relative error
cdef double ALMOST = 0.999999
cdef double ULPS = 4.5e-16      # more than two roundings, relative


cdef class Levels:
    """Equations in the order of evaluation: see `symcheck.numerics.reward_bounds.epoch_system.Layer` for the arrays.

    mode: 0 one row per state, 1 min, 2 max. floor: the lowest level that exists; rows from below it have value 0.
    """

    cdef const int64_t[::1] block, row_ptr, ptr, mid, reward, member_ptr, inverse_at
    cdef const double[::1] inverse
    cdef const int32_t[::1] idx, state, members, clear
    cdef const double[::1] val, slack, steps
    cdef const uint8_t[::1] full
    cdef double[::1] low, high
    cdef uint8_t[::1] one, none
    cdef int64_t floor, limit
    cdef int mode
    cdef double tolerance
    cdef public int64_t sweeps

    def __init__(self, layer, int mode, int64_t floor, const int32_t[::1] clear, double tolerance, int64_t limit):
        self.block, self.row_ptr, self.ptr, self.mid = layer.block, layer.row_ptr, layer.ptr, layer.mid
        self.reward, self.member_ptr = layer.reward, layer.member_ptr
        self.idx, self.state, self.members, self.clear = layer.idx, layer.state, layer.members, clear
        self.val, self.slack, self.steps, self.full = layer.val, layer.slack, layer.steps, layer.full
        self.inverse, self.inverse_at = layer.inverse, layer.inverse_at
        self.low = np.empty(len(layer.reward))
        self.high = np.empty(len(layer.reward))
        self.one = np.empty(len(layer.reward), dtype=np.uint8)
        self.none = np.zeros(1 + int(np.max(layer.members, initial=0)), dtype=np.uint8)
        self.mode, self.floor, self.tolerance, self.limit = mode, floor, tolerance, limit
        self.sweeps = 0

    def advance(self, double[:, :, ::1] x, int64_t level, int64_t stop):
        """Compute the levels from `level` up to `stop` (left out); how many at the end were equal to the one before."""
        cdef int64_t slots = x.shape[0], b, i, same = 0
        cdef int64_t cur, prev
        cdef bint changed
        with nogil:
            while level < stop:
                cur = level % slots
                prev = cur - 1 if cur > 0 else slots - 1
                changed = False
                for i in range(self.clear.shape[0]):
                    x[cur, self.clear[i], 0] = 0.0
                    x[cur, self.clear[i], 1] = 0.0
                for b in range(self.block.shape[0] - 1):
                    if self.block[b + 1] == self.block[b] + 1:
                        changed |= self.single(x, self.block[b], level, cur, prev, slots)
                    else:
                        changed |= self.cycle(x, self.block[b], self.block[b + 1], self.inverse_at[b], level, cur, prev, slots)
                same = 0 if changed else same + 1
                level += 1
        return same

    cdef inline void terms(self, double[:, :, ::1] x, int64_t r, int64_t level, int64_t cur, int64_t slots, double* low,
                           double* high, uint8_t* one) noexcept nogil:
        """What a row has from other levels and blocks, not yet rounded outwards, and whether that is all 1 for certain."""
        cdef int64_t slot = cur - self.reward[r], k
        cdef double lo = 0.0, hi = 0.0, p
        cdef double* at
        if level - self.reward[r] < self.floor:
            low[0] = high[0] = 0.0
            one[0] = 0
            return
        if slot < 0:
            slot += slots
        for k in range(self.ptr[r], self.mid[r]):
            at = &x[slot, self.idx[k], 0]
            p = self.val[k]
            lo += p * at[0]
            hi += p * at[1]
        low[0] = lo
        high[0] = hi
        one[0] = 0
        if self.full[r] and (lo >= ALMOST or self.mid[r] < self.ptr[r + 1]):
            for k in range(self.ptr[r], self.mid[r]):
                if x[slot, self.idx[k], 0] != 1.0:
                    return
            one[0] = 1

    cdef bint write(self, double[:, :, ::1] x, int64_t i, int64_t cur, int64_t prev, double lo, double hi) noexcept nogil:
        """Store the value of a state and those that share it; whether it differs from the level before."""
        cdef int64_t j, s = self.state[i]
        cdef bint changed = x[prev, s, 0] != lo or x[prev, s, 1] != hi
        for j in range(self.member_ptr[i], self.member_ptr[i + 1]):
            x[cur, self.members[j], 0] = lo
            x[cur, self.members[j], 1] = hi
        return changed

    cdef bint single(self, double[:, :, ::1] x, int64_t i, int64_t level, int64_t cur, int64_t prev, int64_t slots) noexcept nogil:
        """A state that no rows without reward lead back to."""
        cdef double lo, hi, low = 0.0, high = 0.0
        cdef uint8_t one
        cdef int64_t r
        cdef bint first = True
        for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
            self.terms(x, r, level, cur, slots, &lo, &hi, &one)
            if one:
                lo = hi = 1.0
            else:
                outwards(&lo, &hi, self.slack[r])
            if first:
                low, high, first = lo, hi, False
            elif self.mode == 2:
                low = lo if lo > low else low
                high = hi if hi > high else high
            else:
                low = lo if lo < low else low
                high = hi if hi < high else high
        return self.write(x, i, cur, prev, low, high)

    cdef inline void best(self, double[:, :, ::1] x, int64_t i, int64_t cur, bint rounded, double* low, double* high) noexcept nogil:
        """The best row of a state of a cycle, by the present values of the others."""
        cdef double lo, hi, p
        cdef int64_t r, k
        cdef bint first = True
        low[0] = high[0] = 0.0
        for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
            lo = self.low[r]
            hi = self.high[r]
            for k in range(self.mid[r], self.ptr[r + 1]):
                p = self.val[k]
                lo += p * x[cur, self.idx[k], 0]
                hi += p * x[cur, self.idx[k], 1]
            if rounded:
                outwards(&lo, &hi, self.slack[r])
            if first:
                low[0], high[0], first = lo, hi, False
            elif self.mode == 2:
                low[0] = lo if lo > low[0] else low[0]
                high[0] = hi if hi > high[0] else high[0]
            else:
                low[0] = lo if lo < low[0] else low[0]
                high[0] = hi if hi < high[0] else high[0]

    cdef bint certain(self, int64_t begin, int64_t end) noexcept nogil:
        """Whether 1 is a solution for all states of a cycle: it is the only one, then."""
        cdef int64_t i, r
        cdef bint some, every
        for i in range(begin, end):
            some, every = False, True
            for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
                if self.one[r]:
                    some = True
                else:
                    every = False
            if not (some if self.mode == 2 else every):
                return False
        return True

    cdef void zeros(self, int64_t begin, int64_t end) noexcept nogil:
        """Mark the states of a cycle with value 0: the most that have a row (for max: all rows) with nothing but these."""
        cdef int64_t i, r, k
        cdef bint some, every, zero, again = True
        for i in range(begin, end):
            self.none[self.state[i]] = 1
        while again:
            again = False
            for i in range(begin, end):
                if not self.none[self.state[i]]:
                    continue
                some, every = False, True
                for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
                    zero = self.high[r] == 0.0
                    k = self.mid[r]
                    while zero and k < self.ptr[r + 1]:
                        zero = self.none[self.idx[k]] != 0
                        k += 1
                    if zero:
                        some = True
                    else:
                        every = False
                if not (every if self.mode == 2 else some):
                    self.none[self.state[i]] = 0
                    again = True

    cdef void solved(self, double[:, :, ::1] x, int64_t begin, int64_t end, int64_t at, int64_t cur) noexcept nogil:
        """A cycle's values by the inverse of its equations, up to rounding; each state has one row."""
        cdef int64_t n = end - begin, i, k, r = self.row_ptr[begin]
        cdef double lo, hi
        for i in range(n):
            lo = hi = 0.0
            for k in range(n):
                lo += self.inverse[at + i * n + k] * self.low[r + k]
                hi += self.inverse[at + i * n + k] * self.high[r + k]
            x[cur, self.state[begin + i], 0] = lo
            x[cur, self.state[begin + i], 1] = hi

    cdef bint cycle(self, double[:, :, ::1] x, int64_t begin, int64_t end, int64_t at, int64_t level, int64_t cur, int64_t prev,
                    int64_t slots) noexcept nogil:
        """States on cycles without reward: sweeps, and then bounds from what is left of the equations.

        With h >= 1 + A h for every choice (`steps`) and a residual of at most e, the solution is within e h.
        """
        cdef int64_t i, r, s, count
        cdef double lo, hi, change, big, longest = 1.0, below = 0.0, above = 0.0, goal, size
        cdef bint changed = False
        for r in range(self.row_ptr[begin], self.row_ptr[end]):
            self.terms(x, r, level, cur, slots, &self.low[r], &self.high[r], &self.one[r])
        if self.certain(begin, end):
            for i in range(begin, end):
                changed |= self.write(x, i, cur, prev, 1.0, 1.0)
            return changed
        self.zeros(begin, end)
        for i in range(begin, end):
            s = self.state[i]
            if self.none[s]:
                changed |= self.write(x, i, cur, prev, 0.0, 0.0)
                continue
            longest = self.steps[i] if self.steps[i] > longest else longest
            x[cur, s, 0] = x[prev, s, 0]
            x[cur, s, 1] = x[prev, s, 1]
        goal = self.tolerance / longest
        goal = goal if goal > 2e-16 else 2e-16
        if at >= 0:
            self.solved(x, begin, end, at, cur)
        for count in range(self.limit if at < 0 else 2):
            change = big = 0.0
            for i in range(begin, end):
                s = self.state[i]
                if self.none[s]:
                    continue
                self.best(x, i, cur, False, &lo, &hi)
                size = fabs(lo - x[cur, s, 0])
                change = size if size > change else change
                size = fabs(hi - x[cur, s, 1])
                change = size if size > change else change
                big = hi if hi > big else big
                x[cur, s, 0] = lo
                x[cur, s, 1] = hi
            self.sweeps += 1
            if change <= goal * big:
                break
        for i in range(begin, end):
            s = self.state[i]
            if self.none[s]:
                continue
            self.best(x, i, cur, True, &lo, &hi)
            size = x[cur, s, 0] - lo
            below = size if size > below else below
            size = hi - x[cur, s, 1]
            above = size if size > above else above
        for i in range(begin, end):
            s = self.state[i]
            if self.none[s]:
                continue
            lo = x[cur, s, 0] - below * self.steps[i] * (1 + 1e-12)
            hi = x[cur, s, 1] + above * self.steps[i] * (1 + 1e-12)
            outwards(&lo, &hi, ULPS)
            changed |= self.write(x, i, cur, prev, lo, hi)
        return changed


cdef inline void outwards(double* lo, double* hi, double slack) noexcept nogil:
    """Rounded outwards, and kept within 0 and 1; 0 stays 0."""
    lo[0] -= lo[0] * slack
    hi[0] += hi[0] * slack
    if lo[0] < SMALL:
        lo[0] = 0.0
    elif lo[0] > 1.0:
        lo[0] = 1.0
    if hi[0] > 1.0:
        hi[0] = 1.0
    elif 0.0 < hi[0] < SMALL:
        hi[0] = SMALL
