# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Policies for x = opt(A x + b), evaluated by extrapolated sweeps, and the verification of bounds.

Sweeps alone need thousands of rounds on slowly mixing blocks (random walks between distant ends). A
linear combination of the last differences removes the slow parts of the error: Anderson (1965), in
the form of Walker & Ni (2011); with sweeps over one policy it is preconditioned GMRES with a short
memory. Nothing is proved until `PolicyEvaluator.verify_bound` says so.
"""

import numpy as np

from libc.math cimport fabs, isfinite, sqrt, INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.tuning cimport ANDERSON_MEMORY, SWEEPS_PER_COMBINATION
from symcheck.kernels.rounding cimport error_of_row, round_down, round_up, underflow_margin

# A row must be better by this relative difference to change the policy: roundings are smaller.
cdef double CLEARLY_BETTER = 1e-13


cdef bint nearly_equal(const double[::1] low, const double[::1] high) noexcept nogil:
    """Whether bounds differ by roundings only, so that the lower ones can stand for their middle.
    """
    cdef int64_t r
    for r in range(low.shape[0]):
        if not high[r] <= low[r] * (1.0 + 1e-14):
            return False
    return True


cdef class PolicyEvaluator:
    """An approximation `x` of the solution of a block of equations, and a policy.

    `policy`: int32[n], a row per state, counted among the rows of its state; -1: none yet.
    `sweeps`: number of sweeps so far. It takes about 75 bytes per state, and a copy of the rows of
    the policy.

    Args:
        indptr, indices, data: int64[rows+1], int32, float64: A without self-loops.
        groups: int64[n+1], the rows of each state; None without choices.
        low, high: float64[rows], bounds on b, at least 0; infinite ones are allowed for minima.
        mode: 0 without choices, 1 minimum, 2 maximum.
        relative: whether errors count relative to the values.
        error: of A and b, relative.
    """

    cdef const int64_t[::1] row_ptr, groups, policy_ptr
    cdef const int32_t[::1] indices, policy_indices
    cdef const double[::1] data, low, high, policy_data, policy_b
    cdef const double[::1] middle
    cdef double[::1] last_image
    cdef float[::1] last_change, weight
    cdef float[:, ::1] residuals, images
    cdef readonly double[::1] x
    cdef readonly int32_t[::1] policy
    cdef readonly int64_t n, sweeps
    cdef int64_t stored, newest, combined
    cdef double norm, scale, error
    cdef readonly int mode
    cdef bint relative
    cdef double product[ANDERSON_MEMORY][ANDERSON_MEMORY]
    cdef double factor[ANDERSON_MEMORY]

    def __init__(self, indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None,
                 low: Floats, high: Floats, int mode, bint relative, double error):
        self.row_ptr, self.groups = indptr, indptr if mode == 0 else groups
        cdef int64_t n = self.groups.shape[0] - 1
        self.indices, self.data, self.low, self.high = indices, data, low, high
        self.mode = mode
        self.relative = relative
        self.error = error
        self.n = n
        if nearly_equal(self.low, self.high):
            self.middle = low
        else:
            self.middle = (low + 0.5 * (high - low)
                           if mode != 1 else np.where(high < np.inf, 0.5 * (low + high), np.inf))
        self.x = np.zeros(n)
        self.policy = np.full(0 if mode == 0 else n, -1, dtype=np.int32)
        self.weight = np.ones(n, dtype=np.float32)
        self.scale = 1.0
        self.use_all_rows()
        self.sweeps = 0
        self.release_history()

    cdef use_all_rows(self):
        """Without choices the rows of the policy are all rows; with choices there are none yet."""
        self.policy_ptr = self.row_ptr
        self.policy_indices, self.policy_data, self.policy_b = self.indices, self.data, self.middle

    def release_history(self):
        """Free the memory of earlier steps until the next evaluation."""
        self.last_image = None
        self.last_change = None
        self.residuals = self.images = None
        self.clear_history()

    cdef allocate_history(self):
        """Allocate the memory of the steps of an evaluation."""
        if self.last_image is None:
            self.last_image, self.last_change = np.empty(self.n), np.empty(self.n, dtype=np.float32)
            self.residuals = np.zeros((self.n, ANDERSON_MEMORY), dtype=np.float32)
            self.images = np.zeros((self.n, ANDERSON_MEMORY), dtype=np.float32)

    cdef void clear_history(self) noexcept nogil:
        """Forget earlier steps."""
        cdef int64_t i, j
        self.stored = self.newest = self.combined = 0
        self.norm = INFINITY
        for i in range(ANDERSON_MEMORY):
            for j in range(ANDERSON_MEMORY):
                self.product[i][j] = 0.0

    def improve(self, int64_t rounds=1) -> tuple[float, int]:
        """Sweep over all rows, and switch to rows that are clearly better.

        Args:
            rounds: number of sweeps.
        Returns:
            The greatest relative change of the last sweep (NaN if a value is NaN or stays
                infinite), and the number of changed choices.
        """
        cdef double change = 0.0
        cdef int64_t changed = 0, k
        for k in range(rounds):
            with nogil:
                if self.mode == 0:
                    change = sweep_policy(self, k & 1)
                else:
                    change = sweep_all_rows(self, &changed)
        self.sweeps += rounds
        if changed:
            self.copy_policy_rows()
        with nogil:
            self.set_weights()
        return change, changed

    def set_policy(self, const int32_t[::1] policy):
        """Continue with another policy: int32[n]."""
        cdef int64_t i
        for i in range(self.n):
            self.policy[i] = policy[i]
        self.copy_policy_rows()
        self.clear_history()

    cdef copy_policy_rows(self):
        """Copy the rows of the policy together."""
        cdef int64_t i, k, r, entries = 0
        self.use_all_rows()  # frees the old copy first
        cdef int64_t[::1] starts = np.empty(self.n + 1, dtype=np.int64)
        with nogil:
            for i in range(self.n):
                starts[i] = entries
                r = self.groups[i] + self.policy[i]
                entries += self.row_ptr[r + 1] - self.row_ptr[r]
            starts[self.n] = entries
        cdef int32_t[::1] indices = np.empty(entries + 1, dtype=np.int32)
        cdef double[::1] data = np.empty(entries + 1), b = np.empty(self.n)
        with nogil:
            for i in range(self.n):
                r = self.groups[i] + self.policy[i]
                b[i] = self.middle[r]
                for k in range(self.row_ptr[r], self.row_ptr[r + 1]):
                    indices[starts[i] + k - self.row_ptr[r]] = self.indices[k]
                    data[starts[i] + k - self.row_ptr[r]] = self.data[k]
        self.policy_ptr, self.policy_indices, self.policy_data, self.policy_b = (starts, indices,
                                                                                 data, b)

    cdef void set_weights(self) noexcept nogil:
        """Set the weight of an error in each state, divided by the greatest value, and forget
        earlier steps.
        """
        cdef int64_t i
        cdef double most = 0.0, a
        for i in range(self.n):
            if self.x[i] > most:
                most = self.x[i]
        self.scale = 1.0 / (most + 1e-297)
        for i in range(self.n):
            a = fabs(self.x[i]) * self.scale if self.relative else 1.0
            self.weight[i] = <float>(1.0 / (a if a > 1e-3 else 1e-3))
        self.clear_history()

    def evaluate(self, double tolerance, int64_t steps) -> float:
        """Evaluate the policy by combination steps.

        Args:
            tolerance: stop when the sweeps of a step change no value by more, relatively.
            steps: most steps.
        Returns:
            The last relative change.
        """
        cdef int64_t k
        cdef double change = INFINITY
        self.allocate_history()
        with nogil:
            for k in range(steps):
                change = self.combination_step()
                if change <= tolerance or not isfinite(change):
                    break
        return change

    cdef double previous_value(self, int64_t i) noexcept nogil:
        """The value of a state before the sweeps of this step."""
        cdef double a = self.last_image[i]
        cdef int64_t j
        for j in range(self.combined):
            a = a - self.factor[j] * self.images[i, j]
        return a

    cdef double combination_step(self) noexcept nogil:
        """Some sweeps, and the combination of them with earlier ones that minimises the residual.
        """
        cdef int64_t i, j, n = self.n
        cdef double f, weighted, a, worst = 0.0, norm = 0.0
        cdef double right[ANDERSON_MEMORY]
        cdef double newest_products[ANDERSON_MEMORY]
        cdef float* row
        cdef bint keep = self.norm < INFINITY
        if not keep:
            for i in range(n):
                self.last_image[i] = self.x[i]
        for j in range(SWEEPS_PER_COMBINATION):
            sweep_policy(self, j & 1)
        self.sweeps += SWEEPS_PER_COMBINATION
        for j in range(ANDERSON_MEMORY):
            right[j] = newest_products[j] = 0.0
        for i in range(n):
            f = self.x[i] - self.previous_value(i)
            if fabs(f) > worst * fabs(self.x[i]) or f != f:
                worst = fabs(f) / fabs(self.x[i])
            weighted = f * self.scale * self.weight[i]
            norm = norm + weighted * weighted
            if keep:
                row = &self.residuals[i, 0]
                row[self.newest] = <float>(weighted - self.last_change[i])
                self.images[i, self.newest] = <float>(self.x[i] - self.last_image[i])
                a = row[self.newest]
                for j in range(ANDERSON_MEMORY):
                    newest_products[j] += a * row[j]
                    right[j] += weighted * row[j]
            self.last_change[i] = <float>weighted
            self.last_image[i] = self.x[i]
        self.store_products(newest_products, keep)
        self.combine(right, sqrt(norm))
        return worst

    cdef void store_products(self, const double* newest_products, bint keep) noexcept nogil:
        """Store the products of the newest difference with the others."""
        cdef int64_t j
        if keep:
            for j in range(ANDERSON_MEMORY):
                self.product[self.newest][j] = self.product[j][self.newest] = newest_products[j]
            self.newest = (self.newest + 1) % ANDERSON_MEMORY
            if self.stored < ANDERSON_MEMORY:
                self.stored += 1

    cdef void combine(self, double* right, double norm) noexcept nogil:
        """Subtract from `x` the combination that minimises the residual."""
        cdef int64_t i, j
        cdef double a
        cdef float* row
        for j in range(ANDERSON_MEMORY):
            self.factor[j] = 0.0
        if norm > 2.0 * self.norm:
            self.clear_history()  # the combination increased the error: restart from plain sweeps
        elif self.stored:
            self.least_squares(right, self.factor)
        self.norm = norm
        self.combined = self.stored
        if self.combined:
            for i in range(self.n):
                a = self.x[i]
                row = &self.images[i, 0]
                for j in range(self.combined):
                    a = a - self.factor[j] * row[j]
                self.x[i] = a

    cdef void least_squares(self, double* right, double* factor) noexcept nogil:
        """Factors that minimise the residual.

        Normal equations by Cholesky decomposition, newest difference first, as far as they are
        independent.
        """
        cdef double root[ANDERSON_MEMORY][ANDERSON_MEMORY]
        cdef double y[ANDERSON_MEMORY]
        cdef int64_t order[ANDERSON_MEMORY]
        cdef int64_t count = self.stored, i, j, q
        cdef double a
        for i in range(count):
            order[i] = (self.newest - 1 - i + 2 * ANDERSON_MEMORY) % ANDERSON_MEMORY
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

    def verify_bound(self, double[::1] y, bint upper, int64_t rounds, int32_t[::1] policy) -> int:
        """Sweep candidate bounds until no value rises (`upper`) or none falls.

        Every sweep is rounded outwards, so values that do not move in the wrong direction are
        bounds. Lower bounds hold down to 1e-300, below which doubles have fewer digits.

        Args:
            y: float64[n], not negative; holds bounds afterwards if they are proved.
            rounds: most sweeps.
            policy: int32[n], receives a policy that attains lower bounds of a maximum or upper
                bounds of a minimum.
        Returns:
            The number of sweeps, or 0 if nothing is proved.
        """
        cdef int64_t k
        cdef bint proved
        for k in range(rounds):
            with nogil:
                proved = sweep_bounds(self, &y[0], upper, policy)
            self.sweeps += 1
            if proved:
                return k + 1
        return 0


cdef inline double add_row(double total, const int64_t* indptr, int64_t row, const double* data,
                           const int32_t* indices, const double* x) noexcept nogil:
    """total + A_row x."""
    cdef int64_t k
    for k in range(indptr[row], indptr[row + 1]):
        total = total + data[k] * x[indices[k]]
    return total


cdef double sweep_all_rows(PolicyEvaluator e, int64_t* changed) noexcept nogil:
    """Sweep over all rows; a choice changes if another row is clearly better."""
    cdef int64_t n = e.n, i, r, k, best_row, old
    cdef double t, best, moved, change = 0.0
    cdef double* x = &e.x[0]
    cdef const double* data = &e.data[0]
    cdef const int32_t* indices = &e.indices[0]
    cdef const int64_t* indptr = &e.row_ptr[0]
    cdef const int64_t* groups = &e.groups[0]
    cdef double less = 1.0 - CLEARLY_BETTER, more = 1.0 + CLEARLY_BETTER
    for i in range(n):
        best_row = old = groups[i] + e.policy[i] if e.policy[i] >= 0 else -1
        best = 0.0
        if old >= 0:
            best = add_row(e.middle[old], indptr, old, data, indices, x)
        for r in range(groups[i], groups[i + 1]):
            if r == old:
                continue
            t = add_row(e.middle[r], indptr, r, data, indices, x)
            if best_row < 0 or (t > best * more if e.mode == 2 else t < best * less):
                best = t
                best_row = r
        if best_row != old:
            changed[0] += 1
            e.policy[i] = <int32_t>(best_row - groups[i])
        moved = fabs(best - x[i])
        if moved > change * fabs(best) or moved != moved:  # NaN remains the greatest change
            change = moved / fabs(best)
        x[i] = best
    return change


cdef double sweep_policy(PolicyEvaluator e, bint backwards) noexcept nogil:
    """Sweep over the rows of the policy; the greatest relative change."""
    cdef int64_t n = e.n, j, i, k
    cdef double t, moved, change = 0.0
    cdef double* x = &e.x[0]
    cdef const double* data = &e.policy_data[0]
    cdef const int32_t* indices = &e.policy_indices[0]
    cdef const double* b = &e.policy_b[0]
    cdef const int64_t* indptr = &e.policy_ptr[0]
    for j in range(n):
        i = n - 1 - j if backwards else j
        t = add_row(b[i], indptr, i, data, indices, x)
        moved = fabs(t - x[i])
        if moved > change * fabs(t) or moved != moved:
            change = moved / fabs(t)
        x[i] = t
    return change


cdef bint sweep_bounds(PolicyEvaluator e, double* x, bint upper,
                       int32_t[::1] policy) noexcept nogil:
    """Replace candidate bounds by the bounds that they prove, rounded outwards; whether they are
    bounds already.
    """
    cdef int64_t n = e.n, i, r, k, first, last, best_row
    cdef double t, best, margin
    cdef bint proved = True, attains = e.mode == (1 if upper else 2)
    cdef const double* data = &e.data[0]
    cdef const int32_t* indices = &e.indices[0]
    cdef const double* b = &e.high[0] if upper else &e.low[0]
    cdef const int64_t* indptr = &e.row_ptr[0]
    cdef const int64_t* groups = &e.groups[0]
    for i in range(n):
        first = i if e.mode == 0 else groups[i]
        last = i + 1 if e.mode == 0 else groups[i + 1]
        best_row = -1
        best = 0.0
        for r in range(first, last):
            t = add_row(b[r], indptr, r, data, indices, x)
            margin = error_of_row(indptr[r + 1] - indptr[r], e.error)
            if upper:
                t = round_up(t, margin)
                if t == 0.0:
                    t = underflow_margin(data, indices, indptr[r], indptr[r + 1], x, 1)
            elif t < INFINITY:
                t = round_down(t, margin)
            if best_row < 0 or (t > best if e.mode == 2 else t < best):
                best = t
                best_row = r
        if not (best <= x[i] if upper else best >= x[i]):
            proved = False
        x[i] = best
        if attains:
            policy[i] = <int32_t>(best_row - first)
    return proved
