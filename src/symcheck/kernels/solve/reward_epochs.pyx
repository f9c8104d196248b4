# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Epochs of a reward bound, one level of the remaining budget after the other.

The values at a level depend on those of lower levels, and on each other through rows without reward
(Hartmanns, Junges, Katoen & Quatmann 2018). Values are pairs (lower, upper), rounded outwards: the
relative error of a row is in `slack`. A ring of `slots` levels is kept. Rows that lead with
certainty to states of value 1 have value 1.
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t

# Below this products may underflow, which is no relative error.
cdef double SMALLEST = 1e-290
# Rows with less cannot lead to value 1 with certainty: a cheap test before the exact one.
cdef double NEARLY_ONE = 0.999999
# More than two roundings, relatively.
cdef double TWO_ROUNDINGS = 4.5e-16


cdef class EpochSolver:
    """Equations in the order of their evaluation.

    Args:
        layer: the arrays; see `symcheck.numerics.reward_bounds.epoch_system`.
        mode: 0 one row per state, 1 minimum, 2 maximum.
        floor: the lowest level that exists; rows from below it have value 0.
        clear: int32, states whose values are 0 at every level.
        tolerance: the aim for the relative error of a component at a level.
        limit: most sweeps over a component at a level.
    """

    cdef const int64_t[::1] block, row_ptr, ptr, mid, reward, member_ptr, inverse_at
    cdef const double[::1] inverse
    cdef const int32_t[::1] idx, state, members, clear
    cdef const double[::1] val, slack, steps
    cdef const uint8_t[::1] full
    cdef double[::1] low, high
    cdef uint8_t[::1] is_one, is_zero
    cdef int64_t floor, limit
    cdef int mode
    cdef double tolerance
    cdef public int64_t sweeps

    def __init__(self, layer, int mode, int64_t floor, const int32_t[::1] clear, double tolerance,
                 int64_t limit):
        self.block, self.row_ptr, self.ptr, self.mid = (layer.block, layer.row_ptr, layer.ptr,
                                                        layer.mid)
        self.reward, self.member_ptr = layer.reward, layer.member_ptr
        self.idx, self.state, self.members, self.clear = (layer.idx, layer.state, layer.members,
                                                          clear)
        self.val, self.slack, self.steps, self.full = (layer.val, layer.slack, layer.steps,
                                                       layer.full)
        self.inverse, self.inverse_at = layer.inverse, layer.inverse_at
        self.low = np.empty(len(layer.reward))
        self.high = np.empty(len(layer.reward))
        self.is_one = np.empty(len(layer.reward), dtype=np.uint8)
        self.is_zero = np.zeros(1 + int(np.max(layer.members, initial=0)), dtype=np.uint8)
        self.mode, self.floor, self.tolerance, self.limit = mode, floor, tolerance, limit
        self.sweeps = 0

    def advance(self, double[:, :, ::1] x, int64_t level, int64_t stop) -> int:
        """Compute the levels from `level` up to `stop` (excluded).

        Args:
            x: float64[slots, states, 2], the ring of levels.
        Returns:
            How many of the last levels were equal to the one before.
        """
        cdef int64_t slots = x.shape[0], b, i, same = 0
        cdef int64_t current, previous
        cdef bint changed
        with nogil:
            while level < stop:
                current = level % slots
                previous = current - 1 if current > 0 else slots - 1
                changed = False
                for i in range(self.clear.shape[0]):
                    x[current, self.clear[i], 0] = 0.0
                    x[current, self.clear[i], 1] = 0.0
                for b in range(self.block.shape[0] - 1):
                    if self.block[b + 1] == self.block[b] + 1:
                        changed |= self.solve_single_state(x, self.block[b], level, current,
                                                           previous, slots)
                    else:
                        changed |= self.solve_component(x, self.block[b], self.block[b + 1],
                                                        self.inverse_at[b], level, current,
                                                        previous, slots)
                same = 0 if changed else same + 1
                level += 1
        return same

    cdef inline void sum_known(self, double[:, :, ::1] x, int64_t r, int64_t level,
                               int64_t current, int64_t slots, double* low, double* high,
                               uint8_t* is_one) noexcept nogil:
        """The contribution of other levels and components to a row, not rounded, and whether it is
        1 with certainty.
        """
        cdef int64_t slot = current - self.reward[r], k
        cdef double lo = 0.0, hi = 0.0, p
        cdef double* at
        if level - self.reward[r] < self.floor:
            low[0] = high[0] = 0.0
            is_one[0] = 0
            return
        if slot < 0:
            slot += slots
        for k in range(self.ptr[r], self.mid[r]):
            at = &x[slot, self.idx[k], 0]
            p = self.val[k]
            lo += p * at[0]
            hi += p * at[1]
            if hi == 0.0 and p > 0.0 and at[1] > 0.0:
                hi = SMALLEST  # the product underflows
        low[0] = lo
        high[0] = hi
        is_one[0] = 0
        if self.full[r] and (lo >= NEARLY_ONE or self.mid[r] < self.ptr[r + 1]):
            for k in range(self.ptr[r], self.mid[r]):
                if x[slot, self.idx[k], 0] != 1.0:
                    return
            is_one[0] = 1

    cdef bint store_value(self, double[:, :, ::1] x, int64_t i, int64_t current, int64_t previous,
                          double lo, double hi) noexcept nogil:
        """Store the value of a state and of those that share it; whether it differs from the level
        before.
        """
        cdef int64_t j, s = self.state[i]
        cdef bint changed = x[previous, s, 0] != lo or x[previous, s, 1] != hi
        for j in range(self.member_ptr[i], self.member_ptr[i + 1]):
            x[current, self.members[j], 0] = lo
            x[current, self.members[j], 1] = hi
        return changed

    cdef bint solve_single_state(self, double[:, :, ::1] x, int64_t i, int64_t level,
                                 int64_t current, int64_t previous, int64_t slots) noexcept nogil:
        """The value of a state on no cycle without reward."""
        cdef double lo, hi, low = 0.0, high = 0.0
        cdef uint8_t is_one
        cdef int64_t r
        cdef bint first = True
        for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
            self.sum_known(x, r, level, current, slots, &lo, &hi, &is_one)
            if is_one:
                lo = hi = 1.0
            else:
                round_outwards(&lo, &hi, self.slack[r])
            if first:
                low, high, first = lo, hi, False
            elif self.mode == 2:
                low = lo if lo > low else low
                high = hi if hi > high else high
            else:
                low = lo if lo < low else low
                high = hi if hi < high else high
        return self.store_value(x, i, current, previous, low, high)

    cdef inline void best_row(self, double[:, :, ::1] x, int64_t i, int64_t current, bint rounded,
                              double* low, double* high) noexcept nogil:
        """The optimum over the rows of a state, by the present values of the others."""
        cdef double lo, hi, p
        cdef int64_t r, k
        cdef bint first = True
        low[0] = high[0] = 0.0
        for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
            lo = self.low[r]
            hi = self.high[r]
            for k in range(self.mid[r], self.ptr[r + 1]):
                p = self.val[k]
                lo += p * x[current, self.idx[k], 0]
                hi += p * x[current, self.idx[k], 1]
            if rounded:
                round_outwards(&lo, &hi, self.slack[r])
            if first:
                low[0], high[0], first = lo, hi, False
            elif self.mode == 2:
                low[0] = lo if lo > low[0] else low[0]
                high[0] = hi if hi > high[0] else high[0]
            else:
                low[0] = lo if lo < low[0] else low[0]
                high[0] = hi if hi < high[0] else high[0]

    cdef bint is_certain(self, int64_t begin, int64_t end) noexcept nogil:
        """Whether 1 is a solution for all states of a component; it is the only one then."""
        cdef int64_t i, r
        cdef bint some, every
        for i in range(begin, end):
            some, every = False, True
            for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
                if self.is_one[r]:
                    some = True
                else:
                    every = False
            if not (some if self.mode == 2 else every):
                return False
        return True

    cdef void mark_zeros(self, int64_t begin, int64_t end) noexcept nogil:
        """Mark the states of a component with value 0.

        They form the greatest set in which each state has a row (maximum: all rows) with no other
        states.
        """
        cdef int64_t i, r, k
        cdef bint some, every, zero, changed = True
        for i in range(begin, end):
            self.is_zero[self.state[i]] = 1
        while changed:
            changed = False
            for i in range(begin, end):
                if not self.is_zero[self.state[i]]:
                    continue
                some, every = False, True
                for r in range(self.row_ptr[i], self.row_ptr[i + 1]):
                    zero = self.high[r] == 0.0
                    k = self.mid[r]
                    while zero and k < self.ptr[r + 1]:
                        zero = self.is_zero[self.idx[k]] != 0
                        k += 1
                    if zero:
                        some = True
                    else:
                        every = False
                if not (every if self.mode == 2 else some):
                    self.is_zero[self.state[i]] = 0
                    changed = True

    cdef void apply_inverse(self, double[:, :, ::1] x, int64_t begin, int64_t end, int64_t at,
                            int64_t current) noexcept nogil:
        """The values of a component by the inverse of its equations, up to rounding; one row per
        state.
        """
        cdef int64_t n = end - begin, i, k, r = self.row_ptr[begin]
        cdef double lo, hi
        for i in range(n):
            lo = hi = 0.0
            for k in range(n):
                lo += self.inverse[at + i * n + k] * self.low[r + k]
                hi += self.inverse[at + i * n + k] * self.high[r + k]
            x[current, self.state[begin + i], 0] = lo
            x[current, self.state[begin + i], 1] = hi

    cdef bint solve_component(self, double[:, :, ::1] x, int64_t begin, int64_t end, int64_t at,
                              int64_t level, int64_t current, int64_t previous,
                              int64_t slots) noexcept nogil:
        """Bounds for states on cycles without reward, from sweeps and the residual of the
        equations.

        With h >= 1 + A h for every choice (`steps`) and a residual of at most e, the solution is
        within e h.
        """
        cdef int64_t i, r, s, count
        cdef double lo, hi, change, largest, most_steps = 1.0, error_below = 0.0, error_above = 0.0
        cdef double threshold, size
        cdef bint changed = False
        for r in range(self.row_ptr[begin], self.row_ptr[end]):
            self.sum_known(x, r, level, current, slots, &self.low[r], &self.high[r],
                           &self.is_one[r])
        if self.is_certain(begin, end):
            for i in range(begin, end):
                changed |= self.store_value(x, i, current, previous, 1.0, 1.0)
            return changed
        self.mark_zeros(begin, end)
        for i in range(begin, end):
            s = self.state[i]
            if self.is_zero[s]:
                changed |= self.store_value(x, i, current, previous, 0.0, 0.0)
                continue
            most_steps = self.steps[i] if self.steps[i] > most_steps else most_steps
            x[current, s, 0] = x[previous, s, 0]
            x[current, s, 1] = x[previous, s, 1]
        threshold = self.tolerance / most_steps
        threshold = threshold if threshold > 2e-16 else 2e-16
        if at >= 0:
            self.apply_inverse(x, begin, end, at, current)
        for count in range(self.limit if at < 0 else 2):
            change = largest = 0.0
            for i in range(begin, end):
                s = self.state[i]
                if self.is_zero[s]:
                    continue
                self.best_row(x, i, current, False, &lo, &hi)
                size = fabs(lo - x[current, s, 0])
                change = size if size > change else change
                size = fabs(hi - x[current, s, 1])
                change = size if size > change else change
                largest = hi if hi > largest else largest
                x[current, s, 0] = lo
                x[current, s, 1] = hi
            self.sweeps += 1
            if change <= threshold * largest:
                break
        for i in range(begin, end):
            s = self.state[i]
            if self.is_zero[s]:
                continue
            self.best_row(x, i, current, True, &lo, &hi)
            size = x[current, s, 0] - lo
            error_below = size if size > error_below else error_below
            size = hi - x[current, s, 1]
            error_above = size if size > error_above else error_above
        for i in range(begin, end):
            s = self.state[i]
            if self.is_zero[s]:
                continue
            lo = x[current, s, 0] - error_below * self.steps[i] * (1 + 1e-12)
            hi = x[current, s, 1] + error_above * self.steps[i] * (1 + 1e-12)
            round_outwards(&lo, &hi, TWO_ROUNDINGS)
            hi = hi if hi > SMALLEST else SMALLEST  # it is not 0, even if all products underflow
            changed |= self.store_value(x, i, current, previous, lo, hi)
        return changed


cdef inline void round_outwards(double* lo, double* hi, double slack) noexcept nogil:
    """Round outwards, within 0 and 1; 0 stays 0."""
    lo[0] -= lo[0] * slack
    hi[0] += hi[0] * slack
    if lo[0] < SMALLEST:
        lo[0] = 0.0
    elif lo[0] > 1.0:
        lo[0] = 1.0
    if hi[0] > 1.0:
        hi[0] = 1.0
    elif 0.0 < hi[0] < SMALLEST:
        hi[0] = SMALLEST
