# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Sweeps over the equations of some states: interval iteration, and optimistic value iteration, rounded outwards.

How rows are widened: kernels/equations.
"""

import numpy as np

from libc.math cimport log, INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.solve.equations cimport Part, index_t

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307


cdef inline double wider(double widest, double low, double high, bint relative) noexcept nogil:
    """The greater of `widest` and the (relative) width of these bounds."""
    cdef double width = high - low
    if not relative:
        return width if width > widest else widest
    # width / upper > widest, without a division where it does not matter
    if width > widest * high:
        width = width / (high if high > 1e-300 else 1e-300)
        if width > widest:
            return width
    return widest


cdef class Block(Part):
    """Equations that are swept over. All bounds in `x` stay bounds, whatever is called in between."""

    cdef void set_choices(self) noexcept nogil:
        """A choice for every state, for where no sweep improves on the start."""
        if self.wide:
            choose(self, &self.ptr64[0], &self.group64[0])
        else:
            choose(self, &self.ptr32[0], &self.group32[0])

    cdef double pair_sweep(self, bint relative, bint backwards) noexcept nogil:
        """One Gauss-Seidel sweep over both bounds; returns the greatest (relative) width that is left."""
        if self.mode == 0:
            if self.wide:
                return chain_sweep(self, &self.ptr64[0], relative, backwards)
            return chain_sweep(self, &self.ptr32[0], relative, backwards)
        if self.wide:
            return choice_sweep(self, &self.ptr64[0], &self.group64[0], relative, backwards)
        return choice_sweep(self, &self.ptr32[0], &self.group32[0], relative, backwards)

    cdef double low_sweep(self, bint relative) noexcept nogil:
        """One Gauss-Seidel sweep over the lower bounds; the differences go to `x[:, 1]`. Returns the greatest change."""
        if self.wide:
            return raise_lower(self, &self.ptr64[0], &self.group64[0], relative)
        return raise_lower(self, &self.ptr32[0], &self.group32[0], relative)

    cdef int high_sweep(self, double[::1] high) noexcept nogil:
        """One Gauss-Seidel sweep over candidate upper bounds. 1: nothing rose, so they are bounds; -1: refuted; 0: neither."""
        if self.wide:
            return lower_upper(self, &self.ptr64[0], &self.group64[0], high)
        return lower_upper(self, &self.ptr32[0], &self.group32[0], high)

    cpdef tuple interval(self, double goal, bint relative, int64_t budget):
        """Sweep both bounds (`x` holds true ones) until they are `goal` apart: (done, sweeps, widest).

        Gives up early when the rate of convergence says that the budget will not do.
        """
        cdef int64_t sweeps = 0
        cdef double widest = INFINITY, before = INFINITY, rate
        cdef bint done = False
        self.begin()
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
        self.begin()
        with nogil:
            if fresh:
                for i in range(self.n):
                    self.bounds[i, 0] = 0.0
            while sweeps < budget:
                before = change
                change = self.low_sweep(relative)
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
                    high[i] = self.bounds[i, 0] * (1.0 + 0.25 * goal) + 2.0 * factor * self.bounds[i, 1]
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
                        self.bounds[i, 1] = high[i]
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


cdef void choose(Block block, const index_t* ptr, const index_t* group) noexcept nogil:
    """A choice for every state that has none, by its upper bounds."""
    cdef int64_t i, r, k, best
    cdef double total, least
    for i in range(block.n):
        if block.picked[i] >= 0:
            continue
        best = group[i]
        least = INFINITY
        for r in range(group[i], group[i + 1]):
            total = block.bh[r]
            for k in range(ptr[r], ptr[r + 1]):
                total = total + block.val[k] * block.bounds[block.idx[k], 1]
            if block.mode == 2:
                total = -total
            if total < least:
                least = total
                best = r
        block.picked[i] = <int32_t>(best - group[i])


cdef double chain_sweep(Block block, const index_t* ptr, bint relative, bint backwards) noexcept nogil:
    """Both bounds, where every state has one row."""
    cdef int64_t i, j, k, n = block.n, end
    cdef double lo, hi, margin, widest = 0.0, a
    cdef double* x = &block.bounds[0, 0]
    cdef double* y
    cdef const double* val = &block.val[0]
    cdef const int32_t* idx = &block.idx[0]
    cdef const double* bl = &block.bl[0]
    cdef const double* bh = &block.bh[0]
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
        widest = wider(widest, y[0], y[1], relative)
    return widest


cdef double choice_sweep(Block block, const index_t* ptr, const index_t* group, bint relative, bint backwards) noexcept nogil:
    """Both bounds, over all choices."""
    cdef int64_t i, j, r, k, n = block.n, first, last
    cdef double lo, hi, best_lo, best_hi, margin, widest = 0.0, a
    cdef int64_t arg_lo, arg_hi
    cdef bint most = block.mode == 2
    cdef double* x = &block.bounds[0, 0]
    cdef double* y
    cdef const double* val = &block.val[0]
    cdef const int32_t* idx = &block.idx[0]
    cdef const double* bl = &block.bl[0]
    cdef const double* bh = &block.bh[0]
    for j in range(n):
        i = n - 1 - j if backwards else j
        first = group[i]
        last = group[i + 1]
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
                block.picked[i] = <int32_t>(arg_lo - first)
        if best_hi < y[1]:
            y[1] = best_hi
            if not most:
                block.picked[i] = <int32_t>(arg_hi - first)
        widest = wider(widest, y[0], y[1], relative)
    return widest


cdef double raise_lower(Block block, const index_t* ptr, const index_t* group, bint relative) noexcept nogil:
    """Lower bounds; the differences go to `x[:, 1]`. Returns the greatest change."""
    cdef int64_t i, r, k, n = block.n, arg
    cdef double lo, best, change, most = 0.0
    cdef double[:, ::1] x = block.bounds
    cdef const double* val = &block.val[0]
    cdef const int32_t* idx = &block.idx[0]
    for i in range(n):
        best = 0.0
        arg = -1
        for r in range(group[i], group[i + 1]):
            lo = block.bl[r]
            for k in range(ptr[r], ptr[r + 1]):
                lo = lo + val[k] * x[idx[k], 0]
            lo = lo - lo * ((ptr[r + 1] - ptr[r] + SLACK) * U)
            if arg < 0 or (lo > best if block.mode == 2 else lo < best):
                best = lo
                arg = r
        change = best - x[i, 0]
        if change > 0.0:
            x[i, 0] = best
            if block.mode == 2:
                block.picked[i] = <int32_t>(arg - group[i])
        else:
            change = 0.0
        x[i, 1] = change
        if relative and change > 0.0:
            change = change / (best if best > 1e-300 else 1e-300)
        if change > most:
            most = change
    return most


cdef int lower_upper(Block block, const index_t* ptr, const index_t* group, double[::1] high) noexcept nogil:
    """Candidate upper bounds. 1: nothing rose, so they are bounds; -1: refuted; 0: neither."""
    cdef int64_t i, r, k, n = block.n, arg
    cdef double hi, best
    cdef int verdict = 1
    cdef const double* val = &block.val[0]
    cdef const int32_t* idx = &block.idx[0]
    for i in range(n):
        best = 0.0
        arg = -1
        for r in range(group[i], group[i + 1]):
            hi = block.bh[r]
            for k in range(ptr[r], ptr[r + 1]):
                hi = hi + val[k] * high[idx[k]]
            hi = hi + (hi * ((ptr[r + 1] - ptr[r] + SLACK) * U) + (TINY if hi > 0.0 else 0.0))
            if arg < 0 or (hi > best if block.mode == 2 else hi < best):
                best = hi
                arg = r
        if best > high[i]:
            verdict = 0
        if best < block.bounds[i, 0]:
            return -1
        high[i] = best
        if block.mode == 1:
            block.picked[i] = <int32_t>(arg - group[i])
    return verdict
