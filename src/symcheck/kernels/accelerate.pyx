# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Candidates for x = opt(A x + b): policies, each evaluated by sweeps that are extrapolated; and the proof that bounds are bounds.

Where sweeps alone need thousands of rounds (random walks between far ends), a linear combination of the last few differences
takes off the slow parts of the error: Anderson (1965), in the form of Walker & Ni (2011); with sweeps over one policy it amounts
to preconditioned GMRES with a short memory. Nothing here is proved until `Candidate.bound` says so.
"""

import numpy as np

from libc.math cimport fabs, isfinite, sqrt, INFINITY
from libc.stdint cimport int32_t, int64_t

cdef double U = 1.1102230246251568e-16   # a little above 2^-53
cdef double SLACK = 8.0
cdef double TINY = 1e-307
cdef double CLEARLY = 1e-13              # rows better by less than this, relatively, are no reason to change a choice

cdef enum:
    MEMORY = 5                           # differences kept
    SWEEPS = 8                           # sweeps per combination


cdef bint together(const double[::1] low, const double[::1] high) noexcept nogil:
    """Whether bounds differ by roundings only, so that one of them will do for the middle."""
    cdef int64_t r
    for r in range(low.shape[0]):
        if not high[r] <= low[r] * (1.0 + 1e-14):
            return False
    return True


cdef class Candidate:
    """An approximation `x` of the solution of a block, as LocalSystem describes it (no self-loops; `b` between low and high).

    mode: 0 without choices, 1 min, 2 max. groups: rows of a state, None without choices. All b are at least 0; with `mode` 1
    they may be infinite. `choice`: the policy, a row per state. Memory: about 100 bytes per state, and a policy's rows.
    """

    cdef const int64_t[::1] ptr, group, now_ptr
    cdef const int32_t[::1] idx, now_idx
    cdef const double[::1] val, low, high, now_val, now_b
    cdef const double[::1] mid
    cdef double[::1] image, last_image, last_change, weight
    cdef float[:, ::1] residuals, images
    cdef readonly double[::1] x
    cdef readonly int64_t[::1] choice
    cdef readonly int64_t n, sweeps
    cdef int64_t filled, place
    cdef double norm
    cdef readonly int mode
    cdef bint relative
    cdef double product[MEMORY][MEMORY]

    def __init__(self, ptr, idx, val, groups, low, high, int mode, bint relative):
        cdef int64_t n = ptr.shape[0] - 1 if mode == 0 else groups.shape[0] - 1
        self.ptr, self.idx, self.val, self.low, self.high = ptr, idx, val, low, high
        self.group = ptr if mode == 0 else groups
        self.mode = mode
        self.relative = relative
        self.n = n
        if together(self.low, self.high):
            self.mid = low
        else:
            self.mid = low + 0.5 * (high - low) if mode != 1 else np.where(high < np.inf, 0.5 * (low + high), np.inf)
        self.x = np.zeros(n)
        self.choice = np.full(0 if mode == 0 else n, -1, dtype=np.int64)
        self.weight = np.ones(n)
        self.now_ptr, self.now_idx, self.now_val, self.now_b = ptr, idx, val, self.mid
        self.sweeps = 0
        self.rest()

    def rest(self):
        """Give the memory of earlier steps back, until the next evaluation."""
        self.image = self.last_image = self.last_change = None
        self.residuals = self.images = None
        self.forget()

    cdef remember(self):
        """Room for the steps of an evaluation."""
        if self.image is None:
            self.image, self.last_image, self.last_change = np.empty(self.n), np.empty(self.n), np.empty(self.n)
            self.residuals = np.zeros((self.n, MEMORY), dtype=np.float32)
            self.images = np.zeros((self.n, MEMORY), dtype=np.float32)

    cdef void forget(self) noexcept nogil:
        cdef int64_t i, j
        self.filled = self.place = 0
        self.norm = INFINITY
        for i in range(MEMORY):
            for j in range(MEMORY):
                self.product[i][j] = 0.0

    def improve(self, int64_t rounds=1):
        """Sweep over all rows, `rounds` times, and take over the best: (greatest relative change of the last, changed choices).

        A change is NaN where some value is no number, or infinite twice.
        """
        cdef double change = 0.0
        cdef int64_t changed = 0, k
        for k in range(rounds):
            with nogil:
                change = self.chain_sweep(&self.x[0], k & 1) if self.mode == 0 else self.choice_sweep(&changed)
        self.sweeps += rounds
        if changed:
            self.adopt()
        with nogil:
            self.weigh()
        return change, changed

    cdef double choice_sweep(self, int64_t* changed) noexcept nogil:
        """Over all rows; a choice changes where another row is clearly better."""
        cdef int64_t n = self.n, i, r, k, arg, old
        cdef double t, best, moved, change = 0.0
        cdef double* x = &self.x[0]
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.ptr[0]
        cdef double less = 1.0 - CLEARLY, more = 1.0 + CLEARLY
        for i in range(n):
            arg = old = self.choice[i]
            best = 0.0
            if old >= 0:
                best = self.mid[old]
                for k in range(ptr[old], ptr[old + 1]):
                    best = best + val[k] * x[idx[k]]
            for r in range(self.group[i], self.group[i + 1]):
                if r == old:
                    continue
                t = self.mid[r]
                for k in range(ptr[r], ptr[r + 1]):
                    t = t + val[k] * x[idx[k]]
                if arg < 0 or (t > best * more if self.mode == 2 else t < best * less):
                    best = t
                    arg = r
            if arg != old:
                changed[0] += 1
                self.choice[i] = arg
            moved = fabs(best - x[i])
            if moved > change * fabs(best) or moved != moved:  # what is no number stays the greatest change
                change = moved / fabs(best)
            x[i] = best
        return change

    def take(self, const int64_t[::1] policy):
        """Go on with a policy from elsewhere: a row per state."""
        cdef int64_t i
        for i in range(self.n):
            self.choice[i] = policy[i]
        self.adopt()
        self.forget()

    cdef adopt(self):
        """Copy the rows of the policy side by side."""
        cdef int64_t n = self.n, i, k, r, entries = 0
        cdef int64_t[::1] ptr = np.empty(n + 1, dtype=np.int64)
        cdef int32_t[::1] idx
        cdef double[::1] val, b
        self.now_ptr, self.now_idx, self.now_val, self.now_b = self.ptr, self.idx, self.val, self.mid  # the old copy goes first
        for i in range(n):
            entries += self.ptr[self.choice[i] + 1] - self.ptr[self.choice[i]]
        idx, val, b = np.empty(entries + 1, dtype=np.int32), np.empty(entries + 1), np.empty(n)
        with nogil:
            entries = 0
            ptr[0] = 0
            for i in range(n):
                r = self.choice[i]
                b[i] = self.mid[r]
                for k in range(self.ptr[r], self.ptr[r + 1]):
                    idx[entries] = self.idx[k]
                    val[entries] = self.val[k]
                    entries += 1
                ptr[i + 1] = entries
        self.now_ptr, self.now_idx, self.now_val, self.now_b = ptr, idx, val, b

    cdef void weigh(self) noexcept nogil:
        """What an error in each state counts; and forget what was measured otherwise."""
        cdef int64_t i
        cdef double most = 0.0, a
        for i in range(self.n):
            if self.x[i] > most:
                most = self.x[i]
        for i in range(self.n):
            a = fabs(self.x[i]) if self.relative else most
            self.weight[i] = 1.0 / (a if a > 1e-3 * most else 1e-3 * most + 1e-300)
        self.forget()

    cdef double chain_sweep(self, double* x, bint backwards) noexcept nogil:
        """Over the rows of the policy. Returns the greatest relative change."""
        cdef int64_t n = self.n, j, i, k
        cdef double t, moved, change = 0.0
        cdef const double* val = &self.now_val[0]
        cdef const int32_t* idx = &self.now_idx[0]
        cdef const int64_t* ptr = &self.now_ptr[0]
        cdef const double* b = &self.now_b[0]
        for j in range(n):
            i = n - 1 - j if backwards else j
            t = b[i]
            for k in range(ptr[i], ptr[i + 1]):
                t = t + val[k] * x[idx[k]]
            moved = fabs(t - x[i])
            if moved > change * fabs(t) or moved != moved:
                change = moved / fabs(t)
            x[i] = t
        return change

    def evaluate(self, double tolerance, int64_t steps):
        """Evaluate the policy, until a step of some sweeps changes nothing by more than `tolerance`: the last (relative) change."""
        cdef int64_t k
        cdef double change = INFINITY
        self.remember()
        with nogil:
            for k in range(steps):
                change = self.step()
                if change <= tolerance or not isfinite(change):
                    break
        return change

    cdef double step(self) noexcept nogil:
        """Some sweeps, and the combination of them with earlier ones that leaves the least."""
        cdef int64_t i, j, n = self.n
        cdef double f, weighted, a, worst = 0.0, norm = 0.0
        cdef double right[MEMORY]
        cdef double fresh[MEMORY]
        cdef double factor[MEMORY]
        cdef float* row
        cdef bint keep = self.norm < INFINITY
        for i in range(n):
            self.image[i] = self.x[i]
        for j in range(SWEEPS):
            self.chain_sweep(&self.image[0], j & 1)
        self.sweeps += SWEEPS
        for j in range(MEMORY):
            right[j] = fresh[j] = factor[j] = 0.0
        for i in range(n):
            f = self.image[i] - self.x[i]
            if fabs(f) > worst * fabs(self.image[i]) or f != f:
                worst = fabs(f) / fabs(self.image[i])
            weighted = f * self.weight[i]
            norm = norm + weighted * weighted
            if keep:
                row = &self.residuals[i, 0]
                row[self.place] = <float>(self.weight[i] * (f - self.last_change[i]))
                self.images[i, self.place] = <float>(self.image[i] - self.last_image[i])
                a = row[self.place]
                for j in range(MEMORY):
                    fresh[j] += a * row[j]
                    right[j] += weighted * row[j]
            self.last_change[i] = f
            self.last_image[i] = self.image[i]
        norm = sqrt(norm)
        if keep:
            for j in range(MEMORY):
                self.product[self.place][j] = self.product[j][self.place] = fresh[j]
            self.place = (self.place + 1) % MEMORY
            if self.filled < MEMORY:
                self.filled += 1
        if norm > 2.0 * self.norm:
            self.forget()  # the combination did harm: start again from plain sweeps, which never do
        elif self.filled:
            self.least(right, factor)
        self.norm = norm
        for i in range(n):
            a = self.image[i]
            if self.filled:
                row = &self.images[i, 0]
                for j in range(self.filled):
                    a = a - factor[j] * row[j]
            self.x[i] = a
        return worst

    cdef void least(self, double* right, double* factor) noexcept nogil:
        """Factors that leave the least residual: normal equations by Cholesky, newest first, as far as they are independent."""
        cdef double root[MEMORY][MEMORY]
        cdef double y[MEMORY]
        cdef int64_t order[MEMORY]
        cdef int64_t count = self.filled, i, j, q
        cdef double a
        for i in range(count):
            order[i] = (self.place - 1 - i + 2 * MEMORY) % MEMORY
        i = 0
        while i < count:
            for j in range(i + 1):
                a = self.product[order[i]][order[j]]
                for q in range(j):
                    a = a - root[i][q] * root[j][q]
                if j < i:
                    root[i][j] = a / root[j][j]
                elif a <= 1e-10 * self.product[order[i]][order[i]]:
                    count = i
                else:
                    root[i][i] = sqrt(a)
            i += 1
        for i in range(count):
            a = right[order[i]]
            for q in range(i):
                a = a - root[i][q] * y[q]
            y[i] = a / root[i][i]
        for i in range(count - 1, -1, -1):
            a = y[i]
            for q in range(i + 1, count):
                a = a - root[q][i] * factor[order[q]]
            factor[order[i]] = a / root[i][i]

    def bound(self, double[::1] y, bint upper, int64_t rounds, int64_t[::1] policy):
        """Sweep `y`, a guess at bounds, until nothing rises (`upper`) or falls: the sweeps that took, or 0 for no proof.

        No number of `y` may be negative. Every sweep is then rounded outwards (lower bounds down to 1e-300, below which doubles
        have fewer digits), so what neither rises nor falls is a bound, and `y` holds it then. With max and lower bounds, or min
        and upper ones, `policy` (int64[n]) becomes one that attains them.
        """
        cdef int64_t k
        cdef bint proved
        for k in range(rounds):
            with nogil:
                proved = self.bound_sweep(&y[0], upper, policy)
            self.sweeps += 1
            if proved:
                return k + 1
        return 0

    cdef bint bound_sweep(self, double* x, bint upper, int64_t[::1] policy) noexcept nogil:
        cdef int64_t n = self.n, i, r, k, first, last, arg
        cdef double t, best, margin
        cdef bint proved = True, attains = self.mode == (1 if upper else 2)
        cdef const double* val = &self.val[0]
        cdef const int32_t* idx = &self.idx[0]
        cdef const int64_t* ptr = &self.ptr[0]
        cdef const double* b = &self.high[0] if upper else &self.low[0]
        for i in range(n):
            first = i if self.mode == 0 else self.group[i]
            last = i + 1 if self.mode == 0 else self.group[i + 1]
            arg = -1
            best = 0.0
            for r in range(first, last):
                t = b[r]
                for k in range(ptr[r], ptr[r + 1]):
                    t = t + val[k] * x[idx[k]]
                margin = (ptr[r + 1] - ptr[r] + SLACK) * U
                if upper:
                    t = t + (t * margin + (TINY if t > 0.0 else 0.0))
                elif t < INFINITY:
                    t = t - t * margin
                if arg < 0 or (t > best if self.mode == 2 else t < best):
                    best = t
                    arg = r
            if not (best <= x[i] if upper else best >= x[i]):
                proved = False
            x[i] = best
            if attains:
                policy[i] = arg
        return proved
