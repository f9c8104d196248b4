# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Candidates for x = opt(A x + b): policies, each evaluated by sweeps that are extrapolated; and the proof that bounds are bounds.

Where sweeps alone need thousands of rounds (random walks between far ends), a linear combination of the last few differences
takes off the slow parts of the error: Anderson (1965), in the form of Walker & Ni (2011); with sweeps over one policy it amounts
to preconditioned GMRES with a short memory. Nothing here is proved until `Candidate.bound` says so.
"""

import numpy as np

from libc.math cimport fabs, isfinite, sqrt, INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.solve.equations cimport index_t

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

    ptr, groups: where rows begin, and the rows of a state (None without choices), int32 or int64 alike. mode: 0 without choices,
    1 min, 2 max. All b are at least 0; with `mode` 1 they may be infinite. `choice`: the policy, a row per state, counted among
    the state's. Memory: about 75 bytes per state, and a policy's rows.
    """

    cdef const int32_t[::1] ptr32, group32, now32
    cdef const int64_t[::1] ptr64, group64, now64
    cdef const int32_t[::1] idx, now_idx
    cdef const double[::1] val, low, high, now_val, now_b
    cdef const double[::1] mid
    cdef double[::1] last_image
    cdef float[::1] last_change, weight
    cdef float[:, ::1] residuals, images
    cdef readonly double[::1] x
    cdef readonly int32_t[::1] choice
    cdef readonly int64_t n, sweeps
    cdef int64_t filled, place, combined
    cdef double norm, scale
    cdef readonly int mode
    cdef bint relative, wide
    cdef double product[MEMORY][MEMORY]
    cdef double factor[MEMORY]

    def __init__(self, ptr, idx, val, groups, low, high, int mode, bint relative):
        cdef int64_t n = ptr.shape[0] - 1 if mode == 0 else groups.shape[0] - 1
        self.wide = ptr.dtype == np.int64
        groups = ptr if mode == 0 else groups
        if self.wide:
            self.ptr64, self.group64 = ptr, groups
        else:
            self.ptr32, self.group32 = ptr, groups
        self.idx, self.val, self.low, self.high = idx, val, low, high
        self.mode = mode
        self.relative = relative
        self.n = n
        if together(self.low, self.high):
            self.mid = low
        else:
            self.mid = low + 0.5 * (high - low) if mode != 1 else np.where(high < np.inf, 0.5 * (low + high), np.inf)
        self.x = np.zeros(n)
        self.choice = np.full(0 if mode == 0 else n, -1, dtype=np.int32)
        self.weight = np.ones(n, dtype=np.float32)
        self.scale = 1.0
        self.all_rows()
        self.sweeps = 0
        self.rest()

    cdef all_rows(self):
        """Without choices the policy's rows are the rows; with them there are none yet."""
        self.now32, self.now64, self.now_idx, self.now_val, self.now_b = self.ptr32, self.ptr64, self.idx, self.val, self.mid

    def rest(self):
        """Give the memory of earlier steps back, until the next evaluation."""
        self.last_image = None
        self.last_change = None
        self.residuals = self.images = None
        self.forget()

    cdef remember(self):
        """Room for the steps of an evaluation."""
        if self.last_image is None:
            self.last_image, self.last_change = np.empty(self.n), np.empty(self.n, dtype=np.float32)
            self.residuals = np.zeros((self.n, MEMORY), dtype=np.float32)
            self.images = np.zeros((self.n, MEMORY), dtype=np.float32)

    cdef void forget(self) noexcept nogil:
        cdef int64_t i, j
        self.filled = self.place = self.combined = 0
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
                if self.mode == 0:
                    change = self.sweep(k & 1)
                elif self.wide:
                    change = choice_sweep(self, &self.ptr64[0], &self.group64[0], &changed)
                else:
                    change = choice_sweep(self, &self.ptr32[0], &self.group32[0], &changed)
        self.sweeps += rounds
        if changed:
            self.adopt()
        with nogil:
            self.weigh()
        return change, changed

    def take(self, const int32_t[::1] policy):
        """Go on with a policy from elsewhere: a row per state, counted among the state's."""
        cdef int64_t i
        for i in range(self.n):
            self.choice[i] = policy[i]
        self.adopt()
        self.forget()

    cdef adopt(self):
        """Copy the rows of the policy side by side."""
        cdef int64_t entries
        cdef int32_t[::1] idx, now32
        cdef int64_t[::1] now64
        cdef double[::1] val, b
        self.all_rows()  # the old copy goes first
        if self.wide:
            entries = entries_of(self, &self.ptr64[0], &self.group64[0])
        else:
            entries = entries_of(self, &self.ptr32[0], &self.group32[0])
        idx, val, b = np.empty(entries + 1, dtype=np.int32), np.empty(entries + 1), np.empty(self.n)
        if self.wide:
            now64 = np.empty(self.n + 1, dtype=np.int64)
            copy_rows(self, &self.ptr64[0], &self.group64[0], &now64[0], &idx[0], &val[0], &b[0])
            self.now64 = now64
        else:
            now32 = np.empty(self.n + 1, dtype=np.int32)
            copy_rows(self, &self.ptr32[0], &self.group32[0], &now32[0], &idx[0], &val[0], &b[0])
            self.now32 = now32
        self.now_idx, self.now_val, self.now_b = idx, val, b

    cdef void weigh(self) noexcept nogil:
        """What an error in each state counts, times the greatest value; and forget what was measured otherwise."""
        cdef int64_t i
        cdef double most = 0.0, a
        for i in range(self.n):
            if self.x[i] > most:
                most = self.x[i]
        self.scale = 1.0 / (most + 1e-297)
        for i in range(self.n):
            a = fabs(self.x[i]) * self.scale if self.relative else 1.0
            self.weight[i] = <float>(1.0 / (a if a > 1e-3 else 1e-3))
        self.forget()

    cdef double sweep(self, bint backwards) noexcept nogil:
        """Over the rows of the policy. Returns the greatest relative change."""
        if self.wide:
            return chain_sweep(self, &self.now64[0], backwards)
        return chain_sweep(self, &self.now32[0], backwards)

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

    cdef double before(self, int64_t i) noexcept nogil:
        """The value of a state before the sweeps of this step: what the last one combined, or what the first one started from."""
        cdef double a = self.last_image[i]
        cdef int64_t j
        for j in range(self.combined):
            a = a - self.factor[j] * self.images[i, j]
        return a

    cdef double step(self) noexcept nogil:
        """Some sweeps, and the combination of them with earlier ones that leaves the least."""
        cdef int64_t i, j, n = self.n
        cdef double f, weighted, a, worst = 0.0, norm = 0.0
        cdef double right[MEMORY]
        cdef double fresh[MEMORY]
        cdef float* row
        cdef bint keep = self.norm < INFINITY
        if not keep:
            for i in range(n):
                self.last_image[i] = self.x[i]
        for j in range(SWEEPS):
            self.sweep(j & 1)
        self.sweeps += SWEEPS
        for j in range(MEMORY):
            right[j] = fresh[j] = 0.0
        for i in range(n):
            f = self.x[i] - self.before(i)
            if fabs(f) > worst * fabs(self.x[i]) or f != f:
                worst = fabs(f) / fabs(self.x[i])
            weighted = f * self.scale * self.weight[i]
            norm = norm + weighted * weighted
            if keep:
                row = &self.residuals[i, 0]
                row[self.place] = <float>(weighted - self.last_change[i])
                self.images[i, self.place] = <float>(self.x[i] - self.last_image[i])
                a = row[self.place]
                for j in range(MEMORY):
                    fresh[j] += a * row[j]
                    right[j] += weighted * row[j]
            self.last_change[i] = <float>weighted
            self.last_image[i] = self.x[i]
        self.remember_products(fresh, keep)
        self.combine(right, sqrt(norm))
        return worst

    cdef void remember_products(self, const double* fresh, bint keep) noexcept nogil:
        """The products of the newest difference with the others, and its place."""
        cdef int64_t j
        if keep:
            for j in range(MEMORY):
                self.product[self.place][j] = self.product[j][self.place] = fresh[j]
            self.place = (self.place + 1) % MEMORY
            if self.filled < MEMORY:
                self.filled += 1

    cdef void combine(self, double* right, double norm) noexcept nogil:
        """Take the combination off `x` that leaves the least residual."""
        cdef int64_t i, j
        cdef double a
        cdef float* row
        for j in range(MEMORY):
            self.factor[j] = 0.0
        if norm > 2.0 * self.norm:
            self.forget()  # the combination did harm: start again from plain sweeps, which never do
        elif self.filled:
            self.least(right, self.factor)
        self.norm = norm
        self.combined = self.filled
        if self.combined:
            for i in range(self.n):
                a = self.x[i]
                row = &self.images[i, 0]
                for j in range(self.combined):
                    a = a - self.factor[j] * row[j]
                self.x[i] = a

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

    def bound(self, double[::1] y, bint upper, int64_t rounds, int32_t[::1] policy):
        """Sweep `y`, a guess at bounds, until nothing rises (`upper`) or falls: the sweeps that took, or 0 for no proof.

        No number of `y` may be negative. Every sweep is then rounded outwards (lower bounds down to 1e-300, below which doubles
        have fewer digits), so what neither rises nor falls is a bound, and `y` holds it then. With max and lower bounds, or min
        and upper ones, `policy` (int32[n]) becomes one that attains them.
        """
        cdef int64_t k
        cdef bint proved
        for k in range(rounds):
            with nogil:
                if self.wide:
                    proved = bound_sweep(self, &self.ptr64[0], &self.group64[0], &y[0], upper, policy)
                else:
                    proved = bound_sweep(self, &self.ptr32[0], &self.group32[0], &y[0], upper, policy)
            self.sweeps += 1
            if proved:
                return k + 1
        return 0


cdef double choice_sweep(Candidate c, const index_t* ptr, const index_t* group, int64_t* changed) noexcept nogil:
    """Over all rows; a choice changes where another row is clearly better."""
    cdef int64_t n = c.n, i, r, k, arg, old
    cdef double t, best, moved, change = 0.0
    cdef double* x = &c.x[0]
    cdef const double* val = &c.val[0]
    cdef const int32_t* idx = &c.idx[0]
    cdef double less = 1.0 - CLEARLY, more = 1.0 + CLEARLY
    for i in range(n):
        arg = old = group[i] + c.choice[i] if c.choice[i] >= 0 else -1
        best = 0.0
        if old >= 0:
            best = c.mid[old]
            for k in range(ptr[old], ptr[old + 1]):
                best = best + val[k] * x[idx[k]]
        for r in range(group[i], group[i + 1]):
            if r == old:
                continue
            t = c.mid[r]
            for k in range(ptr[r], ptr[r + 1]):
                t = t + val[k] * x[idx[k]]
            if arg < 0 or (t > best * more if c.mode == 2 else t < best * less):
                best = t
                arg = r
        if arg != old:
            changed[0] += 1
            c.choice[i] = <int32_t>(arg - group[i])
        moved = fabs(best - x[i])
        if moved > change * fabs(best) or moved != moved:  # what is no number stays the greatest change
            change = moved / fabs(best)
        x[i] = best
    return change


cdef double chain_sweep(Candidate c, const index_t* ptr, bint backwards) noexcept nogil:
    """Over the rows of the policy. Returns the greatest relative change."""
    cdef int64_t n = c.n, j, i, k
    cdef double t, moved, change = 0.0
    cdef double* x = &c.x[0]
    cdef const double* val = &c.now_val[0]
    cdef const int32_t* idx = &c.now_idx[0]
    cdef const double* b = &c.now_b[0]
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


cdef int64_t entries_of(Candidate c, const index_t* ptr, const index_t* group) noexcept nogil:
    """How many entries the policy's rows have."""
    cdef int64_t i, r, entries = 0
    for i in range(c.n):
        r = group[i] + c.choice[i]
        entries += ptr[r + 1] - ptr[r]
    return entries


cdef void copy_rows(Candidate c, const index_t* ptr, const index_t* group, index_t* now, int32_t* idx, double* val,
                    double* b) noexcept nogil:
    """The policy's rows, side by side."""
    cdef int64_t i, k, r, entries = 0
    now[0] = 0
    for i in range(c.n):
        r = group[i] + c.choice[i]
        b[i] = c.mid[r]
        for k in range(ptr[r], ptr[r + 1]):
            idx[entries] = c.idx[k]
            val[entries] = c.val[k]
            entries += 1
        now[i + 1] = <index_t>entries


cdef bint bound_sweep(Candidate c, const index_t* ptr, const index_t* group, double* x, bint upper,
                      int32_t[::1] policy) noexcept nogil:
    """Replace guesses at bounds by what they prove, rounded outwards; whether they are bounds already."""
    cdef int64_t n = c.n, i, r, k, first, last, arg
    cdef double t, best, margin
    cdef bint proved = True, attains = c.mode == (1 if upper else 2)
    cdef const double* val = &c.val[0]
    cdef const int32_t* idx = &c.idx[0]
    cdef const double* b = &c.high[0] if upper else &c.low[0]
    for i in range(n):
        first = i if c.mode == 0 else group[i]
        last = i + 1 if c.mode == 0 else group[i + 1]
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
            if arg < 0 or (t > best if c.mode == 2 else t < best):
                best = t
                arg = r
        if not (best <= x[i] if upper else best >= x[i]):
            proved = False
        x[i] = best
        if attains:
            policy[i] = <int32_t>(arg - first)
    return proved
