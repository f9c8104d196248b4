# Sweeps over a block of equations: interval iteration and optimistic value iteration. All new values
# are rounded outwards (`rounding.pxd`).

cdef inline double widen(double widest, double low, double high, bint relative) noexcept nogil:
    """The greater of `widest` and the (relative) width of these bounds."""
    cdef double w = high - low
    if not relative:
        return w if w > widest else widest
    # width / upper > widest, without a division where it does not matter
    if w > widest * high:
        w = w / (high if high > 1e-300 else 1e-300)
        if w > widest:
            return w
    return widest


cdef class Block(EquationBlock):
    """A block of equations with sweeps. The bounds in `x` remain bounds, whatever is called in
    between.
    """

    def interval_iteration(self, double width, bint relative, int64_t budget) -> tuple[bool, int, float]:
        """Sweep both bounds until they are `width` apart (Haddad & Monmege 2018; Baier et al.
        2017).

        Args:
            width: the aim, relative to the upper bound if `relative`.
            budget: most sweeps. It gives up early when the observed rate says that they do not
                suffice.
        Returns:
            (done, number of sweeps, greatest width).
        """
        cdef int64_t sweeps = 0
        cdef double widest = INFINITY, before = INFINITY, rate
        cdef bint done = False
        self.start_bounds()
        with nogil:
            if self.mode != 0:
                self.choose_missing_rows()
            while sweeps < budget:
                # Three sweeps in the order of the states, then one against it.
                widest = self.sweep_bounds(relative, sweeps % 4 == 3)
                sweeps += 1
                if widest <= width:
                    done = True
                    break
                if sweeps % 32 == 0:
                    if sweeps >= 64 and before < INFINITY:
                        rate = widest / before
                        if (rate >= 0.999999
                                or sweeps + 32.0 * log(width / widest) / log(rate) > 4.0 * budget):
                            break
                    before = widest
        return done, sweeps, widest

    def optimistic_value_iteration(self, double width, bint relative, int64_t budget,
                                           bint restart=True) -> tuple[bool, int, float]:
        """Optimistic value iteration (Hartmanns & Kaminski 2020).

        Lower bounds come from sweeps; upper bounds are guessed from them, scaled by the observed
        rate of convergence, and verified.

        Args:
            width, relative, budget: as in `interval_iteration`.
            restart: whether to start from 0 instead of the lower bounds in `x`.
        Returns:
            (done, number of sweeps, greatest width).
        """
        cdef int64_t sweeps = 0, attempt, i, last_guess = 0
        cdef double change = INFINITY, before = INFINITY, rate = 0.5, factor, tolerance = width
        cdef double widest = INFINITY
        cdef int verdict
        cdef bint done = False
        cdef double[::1] high = np.empty(self.n)
        self.start_bounds()
        with nogil:
            if restart:
                for i in range(self.n):
                    self.bounds[i, 0] = 0.0
            while sweeps < budget:
                before = change
                change = self.sweep_lower(relative)
                sweeps += 1
                if change > 0.0 and before > 0.0 and before < INFINITY:
                    rate = 0.7 * rate + 0.3 * (change / before)
                if rate > 0.9999999:
                    rate = 0.9999999
                factor = 1.0 / (1.0 - rate)
                if change * factor > tolerance and sweeps - last_guess < 1000:
                    continue
                # The remaining increase is about change / (1 - rate); a little more is a bound
                # soon.
                last_guess = sweeps
                for i in range(self.n):
                    high[i] = (self.bounds[i, 0] * (1.0 + 0.25 * width)
                               + 2.0 * factor * self.bounds[i, 1])
                    if not relative:
                        high[i] = high[i] + 0.25 * width
                verdict = 0
                # The slack of the guess arises at states with rewards, and takes sweeps to spread.
                for attempt in range(30 + sweeps // 2):
                    verdict = self.sweep_upper(high)
                    sweeps += 1
                    if verdict != 0:
                        break
                if verdict == 1:
                    for i in range(self.n):
                        self.bounds[i, 1] = high[i]
                    widest = INFINITY
                    while sweeps < budget:
                        widest = self.sweep_bounds(relative, False)
                        sweeps += 1
                        if widest <= width:
                            done = True
                            break
                    break
                tolerance = tolerance * 0.2
                if tolerance < 1e-17:
                    break
        return done, sweeps, widest

    cdef void choose_missing_rows(self) noexcept nogil:
        """Choose a row by the upper bounds for every state without one, for the case that no sweep
        improves the start.
        """
        cdef const int64_t* indptr = &self.row_ptr[0]
        cdef const int64_t* groups = &self.group_ptr[0]
        cdef int64_t i, r, k, best
        cdef double total, least
        for i in range(self.n):
            if self.policy_rows[i] >= 0:
                continue
            best = groups[i]
            least = INFINITY
            for r in range(groups[i], groups[i + 1]):
                total = self.constant_high[r]
                for k in range(indptr[r], indptr[r + 1]):
                    total = total + self.data[k] * self.bounds[self.indices[k], 1]
                if self.mode == 2:
                    total = -total
                if total < least:
                    least = total
                    best = r
            self.policy_rows[i] = <int32_t>(best - groups[i])

    cdef double sweep_chain(self, bint relative, bint backwards) noexcept nogil:
        """`sweep_bounds` for states with one row each."""
        cdef const int64_t* indptr = &self.row_ptr[0]
        cdef int64_t i, j, k, n = self.n, end
        cdef double lo, hi, margin, widest = 0.0, a
        cdef double* x = &self.bounds[0, 0]
        cdef double* y
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        cdef const double* constant_low = &self.constant_low[0]
        cdef const double* constant_high = &self.constant_high[0]
        for j in range(n):
            i = n - 1 - j if backwards else j
            lo = constant_low[i]
            hi = constant_high[i]
            end = indptr[i + 1]
            for k in range(indptr[i], end):
                a = data[k]
                y = x + 2 * <int64_t>indices[k]
                lo = lo + a * y[0]
                hi = hi + a * y[1]
            margin = error_of_row(end - indptr[i], self.system.error)
            lo = round_down(lo, margin)
            hi = round_up(hi, margin)
            if hi == 0.0:
                hi = underflow_margin(data, indices, indptr[i], end, x + 1, 2)
            y = x + 2 * i
            if lo > y[0]:
                y[0] = lo
            if hi < y[1]:
                y[1] = hi
            widest = widen(widest, y[0], y[1], relative)
        return widest

    cdef double sweep_bounds(self, bint relative, bint backwards) noexcept nogil:
        """One Gauss-Seidel sweep over both bounds; the greatest (relative) width that is left."""
        cdef int64_t i, j, r, k, n = self.n, first, last
        cdef double lo, hi, best_lo, best_hi, margin, widest = 0.0, a
        cdef int64_t row_lo, row_hi
        cdef bint maximise = self.mode == 2
        cdef double* x = &self.bounds[0, 0]
        cdef double* y
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        cdef const double* constant_low = &self.constant_low[0]
        cdef const double* constant_high = &self.constant_high[0]
        cdef const int64_t* indptr = &self.row_ptr[0]
        cdef const int64_t* groups = &self.group_ptr[0]
        if self.mode == 0:
            return self.sweep_chain(relative, backwards)
        for j in range(n):
            i = n - 1 - j if backwards else j
            first = groups[i]
            last = groups[i + 1]
            y = x + 2 * i
            if first == last:
                y[0] = 0.0
                y[1] = 0.0
                continue
            best_lo = best_hi = 0.0
            row_lo = row_hi = first
            for r in range(first, last):
                lo = constant_low[r]
                hi = constant_high[r]
                for k in range(indptr[r], indptr[r + 1]):
                    a = data[k]
                    y = x + 2 * <int64_t>indices[k]
                    lo = lo + a * y[0]
                    hi = hi + a * y[1]
                margin = error_of_row(indptr[r + 1] - indptr[r], self.system.error)
                lo = round_down(lo, margin)
                hi = round_up(hi, margin)
                if hi == 0.0:
                    hi = underflow_margin(data, indices, indptr[r], indptr[r + 1], x + 1, 2)
                if r == first or (lo > best_lo if maximise else lo < best_lo):
                    best_lo = lo
                    row_lo = r
                if r == first or (hi > best_hi if maximise else hi < best_hi):
                    best_hi = hi
                    row_hi = r
            y = x + 2 * i
            if best_lo > y[0]:
                y[0] = best_lo
                if maximise:
                    self.policy_rows[i] = <int32_t>(row_lo - first)
            if best_hi < y[1]:
                y[1] = best_hi
                if not maximise:
                    self.policy_rows[i] = <int32_t>(row_hi - first)
            widest = widen(widest, y[0], y[1], relative)
        return widest

    cdef double sweep_lower(self, bint relative) noexcept nogil:
        """One Gauss-Seidel sweep over the lower bounds; the changes go to `x[:, 1]`. The greatest
        change.
        """
        cdef const int64_t* indptr = &self.row_ptr[0]
        cdef const int64_t* groups = &self.group_ptr[0]
        cdef int64_t i, r, k, n = self.n, best_row
        cdef double lo, best, change, greatest = 0.0
        cdef double[:, ::1] x = self.bounds
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        for i in range(n):
            best = 0.0
            best_row = -1
            for r in range(groups[i], groups[i + 1]):
                lo = self.constant_low[r]
                for k in range(indptr[r], indptr[r + 1]):
                    lo = lo + data[k] * x[indices[k], 0]
                lo = round_down(lo, error_of_row(indptr[r + 1] - indptr[r], self.system.error))
                if best_row < 0 or (lo > best if self.mode == 2 else lo < best):
                    best = lo
                    best_row = r
            change = best - x[i, 0]
            if change > 0.0:
                x[i, 0] = best
                if self.mode == 2:
                    self.policy_rows[i] = <int32_t>(best_row - groups[i])
            else:
                change = 0.0
            x[i, 1] = change
            if relative and change > 0.0:
                change = change / (best if best > 1e-300 else 1e-300)
            if change > greatest:
                greatest = change
        return greatest

    cdef int sweep_upper(self, double[::1] high) noexcept nogil:
        """One Gauss-Seidel sweep over candidate upper bounds.

        1: no value rose, so they are bounds; -1: they are refuted; 0: neither.
        """
        cdef const int64_t* indptr = &self.row_ptr[0]
        cdef const int64_t* groups = &self.group_ptr[0]
        cdef int64_t i, r, k, n = self.n, best_row
        cdef double hi, best
        cdef int verdict = 1
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        for i in range(n):
            best = 0.0
            best_row = -1
            for r in range(groups[i], groups[i + 1]):
                hi = self.constant_high[r]
                for k in range(indptr[r], indptr[r + 1]):
                    hi = hi + data[k] * high[indices[k]]
                hi = round_up(hi, error_of_row(indptr[r + 1] - indptr[r], self.system.error))
                if hi == 0.0:
                    hi = underflow_margin(data, indices, indptr[r], indptr[r + 1], &high[0],
                                           1)
                if best_row < 0 or (hi > best if self.mode == 2 else hi < best):
                    best = hi
                    best_row = r
            if best > high[i]:
                verdict = 0
            if best < self.bounds[i, 0]:
                return -1
            high[i] = best
            if self.mode == 1:
                self.policy_rows[i] = <int32_t>(best_row - groups[i])
        return verdict
