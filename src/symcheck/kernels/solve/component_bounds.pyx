# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Bounds for x = A x + b with non-negative A and b, component by component: the cheap means, as far as they go.

How rows are widened: kernels/equations.
"""

import numpy as np

from libc.float cimport DBL_MAX, DBL_MIN
from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.solve.equations cimport Equations, Part, index_t
from symcheck.kernels.solve.sweeps cimport Block

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307

cdef int64_t FEW = 20000      # states of a block with choices that is swept a little at once
cdef int64_t EFFORT = 50000   # entries that such sweeps go over


cdef bint eliminate(Part part):
    """Solve a block without choices by elimination without subtraction (Grassmann, Taksar & Heyman 1985).

    In a full matrix, for few states; the error is bounded as in kernels/eliminate. False where some state cannot leave, or
    where numbers leave the range of normal doubles: sums that are normal have lost no more than a rounding.
    """
    cdef int64_t n = part.n, i, j, k
    cdef double[:, ::1] m = np.zeros((n, n))
    cdef double[::1] v = part.leaving()
    cdef double[::1] s = np.empty(n)
    cdef double g, error
    cdef bint lost = False
    cdef int64_t updates = 0
    cdef long double total, lo, hi
    part.begin()
    with nogil:
        if part.wide:
            fill(part, &part.ptr64[0], m)
        else:
            fill(part, &part.ptr32[0], m)
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
                    part.bl[i] += g * part.bl[k]
                    part.bh[i] += g * part.bh[k]
                    if g < DBL_MIN or (v[i] < DBL_MIN and v[k] > 0.0) or (part.bl[i] < DBL_MIN and part.bl[k] > 0.0):
                        lost = True
        error = (10.0 * updates + 10.0 * n + 20.0) * U
        for k in range(n):
            lo = part.bl[k]
            hi = part.bh[k]
            for j in range(k):
                lo = lo + <long double>m[k, j] * part.bounds[j, 0]
                hi = hi + <long double>m[k, j] * part.bounds[j, 1]
            part.bounds[k, 0] = <double>(lo / s[k])
            part.bounds[k, 1] = <double>(hi / s[k])
            if (lo > 0.0 and part.bounds[k, 0] < DBL_MIN) or (part.bounds[k, 1] > DBL_MAX and hi <= DBL_MAX):
                lost = True
        for k in range(n):
            part.bounds[k, 0] = part.bounds[k, 0] * (1.0 - error)
            part.bounds[k, 1] = part.bounds[k, 1] * (1.0 + error) + (TINY if part.bounds[k, 1] > 0.0 else 0.0)
    return not lost


cdef void fill(Part part, const index_t* ptr, double[:, ::1] m) noexcept nogil:
    """Add the entries of a part to a full matrix."""
    cdef int64_t i, e
    for i in range(part.n):
        for e in range(ptr[i], ptr[i + 1]):
            m[i, part.idx[e]] += part.val[e]


cdef class System(Equations):
    """The whole problem, and how far its components are solved at once."""

    def block(self, const int32_t[::1] states, double[:, ::1] x, bint wide=False):
        """The block of `states`, the others' bounds known; `wide`: with room for 2**31 entries even where there are fewer."""
        cdef Block block = Block()
        block.load(self, states, x, wide)
        return block

    def store(self, Block block, double[:, ::1] x, int64_t[::1] strategy):
        """Write a block's bounds and choices back."""
        block.begin()
        block.store(x, strategy)

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
        cdef bint infinite = False, constants = self.bl is not None
        for r in range(first, last):
            lo = self.bl[r] if constants else 0.0
            hi = self.bh[r] if constants else 0.0
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
            if loop > 0.0 or self.rates:
                total = self.exit[r] if self.exit is not None else 0.0
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
        if strategy.shape[0]:
            strategy[s] = best
        return not infinite

    def sweep_acyclic(self, double[:, ::1] x, int64_t[::1] strategy, bint descending):
        """All states in index order, where every edge but loops leads to states that come earlier in that order."""
        cdef int64_t i, s
        with nogil:
            for i in range(self.n):
                s = self.n - 1 - i if descending else i
                if self.unknown is None or self.unknown[s]:
                    self.single(s, x, strategy)

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
            block.load(self, states, x, False)
            if not block.open_ or (block.mode == 0 and size > small):
                break
            if block.mode == 0:
                done = eliminate(block)
                counters[1] += 1
                counters[4] = max(counters[4], size)
            else:
                goal = deep[component] * share
                sweeps = min(400, max(24, EFFORT // (block.entries + block.n + 1)))
                if probability:
                    done, sweeps, _ = block.interval(goal, relative, sweeps)
                else:
                    done, sweeps, _ = block.optimistic(goal, relative, sweeps)
                counters[3] += sweeps
                counters[2] += done
                counters[5] = max(counters[5], size if done else 0)
            if not done:
                break
            with nogil:
                block.store(x, strategy)
            component += 1
        return component
