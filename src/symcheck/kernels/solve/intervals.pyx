# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Best expectations over intervals of probabilities, and iteration with them.

An interval row holds the distributions p with lower <= p <= upper and sum 1. Its least (greatest)
expectation of x gives each successor its lower end, and then as much as fits to the successors with
the least (greatest) values (Givan, Leach & Dean 2000). Bounds hold for all ends that differ from the
given ones by a relative error, and for the mass that is distributed then. Functions raise MemoryError
when memory ends.
"""

import numpy as np

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.rounding cimport UNDERFLOW_MARGIN, UNIT_ROUNDOFF, round_down, round_up


cdef struct Rows:
    const int64_t* indptr
    const int32_t* indices
    const double* lower
    const double* upper
    int32_t* order  # per row its entries in the order of the last values, as offsets
    double error  # of ends, and of their sums in a row


cdef double expectation(Rows rows, int64_t r, const double* x, bint greatest,
                        bint above) noexcept nogil:
    """The best expectation of x >= 0 by row r, rounded up (`above`) or down."""
    cdef int64_t begin = rows.indptr[r], k = rows.indptr[r + 1] - begin, i, j, m
    cdef const int32_t* indices = rows.indices + begin
    cdef const double* lower = rows.lower + begin
    cdef const double* upper = rows.upper + begin
    cdef int32_t* order = rows.order + begin
    cdef double total = 0.0, mass = 0.0, rest, share, margin, value
    cdef int32_t moved
    cdef bint is_point = True, positive = False
    for i in range(k):
        value = x[indices[i]]
        total += lower[i] * value
        mass += lower[i]
        is_point &= lower[i] == upper[i]
        positive |= value > 0.0
    if not is_point:
        for j in range(1, k):  # the order of the last values is nearly right
            moved = order[j]
            value = x[indices[moved]]
            m = j
            while m > 0 and (x[indices[order[m - 1]]] < value if greatest
                             else x[indices[order[m - 1]]] > value):
                order[m] = order[m - 1]
                m -= 1
            order[m] = moved
        margin = (k + 4) * UNIT_ROUNDOFF + rows.error
        rest = 1.0 - mass + (margin if above else -margin)
        for j in range(k):
            if rest <= 0.0:
                break
            i = order[j]
            margin = (4.0 * UNIT_ROUNDOFF + 2.0 * rows.error) * upper[i]
            share = upper[i] - lower[i] + (margin if above == greatest else -margin)
            if share > rest:
                share = rest
            if share > 0.0:
                total += share * x[indices[i]]
                rest -= share
        if above and rest > 0.0:
            total += rest * x[indices[order[0 if greatest else k - 1]]]
    if not above:
        return round_down(total, (2 * k + 10) * UNIT_ROUNDOFF + rows.error)
    return round_up(total, (2 * k + 10) * UNIT_ROUNDOFF + rows.error) if total > 0.0 else (
        UNDERFLOW_MARGIN if positive else 0.0)


cdef class IntervalRows:
    """Rows of intervals.

    Args:
        indptr, indices: the entries of each row, as in SparseMatrix.
        lower, upper: float64[entries], the ends.
        greatest: whether nature maximises.
        error: of ends, and of their sums in a row, relative.
    """

    cdef Rows rows
    cdef bint greatest
    cdef object kept

    def __init__(self, const int64_t[::1] indptr, const int32_t[::1] indices,
                 const double[::1] lower, const double[::1] upper, bint greatest,
                 double error) -> None:
        lengths = np.diff(indptr)
        order = np.arange(len(indices)) - np.repeat(np.asarray(indptr)[:-1], lengths)
        cdef int32_t[::1] offsets = np.append(order, 0).astype(np.int32)
        self.kept = indptr, indices, lower, upper, offsets
        self.greatest = greatest
        self.rows.error = error
        self.rows.indptr = &indptr[0]
        self.rows.order = &offsets[0]
        if len(indices):
            self.rows.indices = &indices[0]
            self.rows.lower = &lower[0]
            self.rows.upper = &upper[0]

    def multiply(self, const double[::1] x, bint above) -> Floats:
        """The best expectation of x >= 0 (float64[columns]) by each row, rounded up or down."""
        cdef int64_t n = len(self.kept[0]) - 1, r
        cdef double[::1] out = np.empty(n)
        with nogil:
            for r in range(n):
                out[r] = expectation(self.rows, r, &x[0], self.greatest, above)
        return np.asarray(out)


    def chosen(self, const double[::1] x) -> Floats:
        """The best distribution of each row for x >= 0, float64[entries]."""
        cdef int64_t n = len(self.kept[0]) - 1, r, j, begin, e
        cdef double[::1] out = np.array(self.kept[2])
        cdef double rest, share
        with nogil:
            for r in range(n):
                expectation(self.rows, r, &x[0], self.greatest, False)  # sorts the entries
                begin, rest = self.rows.indptr[r], 1.0
                for e in range(begin, self.rows.indptr[r + 1]):
                    rest -= out[e]
                for j in range(self.rows.indptr[r + 1] - begin):
                    e = begin + self.rows.order[begin + j]
                    share = max(0.0, min(rest, self.rows.upper[e] - self.rows.lower[e]))
                    out[e] += share
                    rest -= share
        return np.asarray(out)


cdef class Iteration:
    """Bounds for x = opt(best expectation of x + constant), component by component.

    Lower bounds grow from those that are given. Where they hardly change, upper bounds are guessed
    above them; they are proved when a sweep increases none of them (optimistic value iteration,
    Hartmanns & Kaminski 2020). Or both are guessed around a candidate, and the lower ones are proved
    when a sweep decreases none of them. Every strategy leaves each component almost surely, or earns
    rewards for ever.

    Args:
        rows: the rows.
        groups: int64[n+1], the rows of each state.
        low, high: float64[rows], bounds of the constants.
        states, starts: the components, in an order in which each leads to earlier ones only.
        x, y: float64[columns], lower and upper bounds. Those of the first n columns, the states, are
            written; others are known.
        candidate: float64[columns], approximate values; none if it is empty.
        maximise: whether the player maximises.
        limit: upper bounds that are known to hold, 1 or infinity.
        epsilon: the relative width that is aimed at.
        most: the largest number of sweeps of a component.
    """

    cdef IntervalRows rows
    cdef const int64_t[::1] groups
    cdef const double[::1] low, high
    cdef const int32_t[::1] states
    cdef const int64_t[::1] starts
    cdef double[::1] x, y
    cdef const double[::1] candidate
    cdef bint maximise
    cdef double limit, epsilon, stop, guess
    cdef int64_t most, component, sweeps, tries, patience
    cdef bint guessed, warm, low_proved, high_proved
    cdef readonly int64_t total
    cdef readonly bint failed

    def __init__(self, IntervalRows rows, const int64_t[::1] groups, const double[::1] low,
                 const double[::1] high, const int32_t[::1] states, const int64_t[::1] starts,
                 double[::1] x, double[::1] y, const double[::1] candidate, bint maximise,
                 double limit, double epsilon, int64_t most) -> None:
        self.rows, self.groups, self.low, self.high = rows, groups, low, high
        self.states, self.starts, self.x, self.y = states, starts, x, y
        self.maximise, self.limit, self.epsilon, self.most = maximise, limit, epsilon, most
        self.candidate = candidate
        self.start(0)

    cdef void start(self, int64_t component) noexcept nogil:
        self.component = component
        self.sweeps = self.tries = 0
        self.patience = 64  # the sweeps in which a guess may be proved: its slack has to spread
        self.warm = self.candidate.shape[0] > 0
        self.guessed, self.low_proved = False, not self.warm
        self.stop = 0.1 * self.epsilon
        self.guess = self.epsilon

    cdef double best(self, int64_t s, bint above) noexcept nogil:
        """The value of the best row of a state."""
        cdef double found = -INFINITY if self.maximise else INFINITY, value
        cdef int64_t r
        cdef double* x = &self.y[0] if above else &self.x[0]
        for r in range(self.groups[s], self.groups[s + 1]):
            value = expectation(self.rows.rows, r, x, self.rows.greatest, above)
            if above:
                value = round_up(value + self.high[r], 2.0 * UNIT_ROUNDOFF)
            else:
                value = round_down(value + self.low[r], 2.0 * UNIT_ROUNDOFF)
            if value > found if self.maximise else value < found:
                found = value
        return found

    cdef bint is_trivial(self, int64_t s) noexcept nogil:
        """Whether a component of one state has no loop."""
        cdef int64_t e, end = self.rows.rows.indptr[self.groups[s + 1]]
        for e in range(self.rows.rows.indptr[self.groups[s]], end):
            if self.rows.rows.indices[e] == s:
                return False
        return True

    cdef double ratio(self, int64_t begin, int64_t end, const double* x,
                      const double* y) noexcept nogil:
        """The largest x / y of the successors of a component that are finished or known."""
        cdef int64_t i, e, t
        cdef double found = 1.0
        for i in range(begin, end):
            for e in range(self.rows.rows.indptr[self.groups[self.states[i]]],
                           self.rows.rows.indptr[self.groups[self.states[i] + 1]]):
                t = self.rows.rows.indices[e]
                if y[t] > 0.0:
                    found = max(found, x[t] / y[t])
        return found

    cdef void guess_bounds(self, int64_t begin, int64_t end) noexcept nogil:
        """Bounds around the candidate, or upper bounds above the lower ones."""
        cdef int64_t i, s
        cdef double above, below
        cdef const double* middle = &self.candidate[0] if self.warm else &self.x[0]
        for i in range(begin, end):  # they do not count for the ratios
            s = self.states[i]
            self.y[s] = 0.0
            if self.warm:
                self.x[s] = INFINITY
        above = (1.0 + self.guess) * self.ratio(begin, end, &self.y[0], middle)
        below = (1.0 + self.guess) * (
            self.ratio(begin, end, middle, &self.x[0]) if self.warm else 1.0)
        for i in range(begin, end):
            s = self.states[i]
            self.y[s] = min(middle[s] * above, self.limit)
            if self.warm:
                self.x[s] = middle[s] / below
        self.guessed, self.high_proved, self.low_proved = True, False, not self.warm

    cdef bint sweep(self, int64_t begin, int64_t end) noexcept nogil:
        """A sweep over a component; whether its bounds are proved."""
        cdef int64_t i, s
        cdef double value, change = 0.0
        cdef bint rising = True, falling = True
        if self.warm and not self.guessed:
            self.guess_bounds(begin, end)
        for i in range(begin, end):  # forwards and backwards in turn
            s = self.states[i if self.sweeps & 1 else begin + end - 1 - i]
            value = self.best(s, False)
            if value > self.x[s]:
                change = max(change, 1.0 - self.x[s] / value)
                self.x[s] = value
            elif value < self.x[s] and not self.low_proved:
                rising = False
                self.x[s] = value
            if self.guessed:
                value = min(self.best(s, True), self.limit)
                falling &= value <= self.y[s]
                self.y[s] = min(value, self.y[s]) if self.high_proved else value
        self.low_proved |= rising
        self.high_proved |= self.guessed and falling
        if self.guessed:
            if self.low_proved and self.high_proved:
                return True
            self.tries += 1
            if self.tries < self.patience + (end - begin if self.warm else 0):
                return False
            self.tries, self.guessed, self.patience = 0, False, 2 * self.patience
            if self.stop > UNIT_ROUNDOFF and not self.warm:
                self.stop *= 0.1
            else:
                self.guess *= 10.0
            if self.warm and self.guess > 0.1:
                self.warm, self.low_proved, self.guess = False, True, self.epsilon
                for i in range(begin, end):
                    self.x[self.states[i]] = 0.0
        elif change <= self.stop:
            self.guess_bounds(begin, end)
        return False

    def run(self, int64_t work) -> bool:
        """Continue for about this many updates of states; whether all components are finished."""
        cdef int64_t begin, end, i
        with nogil:
            while work > 0 and self.component < self.starts.shape[0] - 1:
                begin, end = self.starts[self.component], self.starts[self.component + 1]
                work -= end - begin
                self.total += 1
                self.sweeps += 1
                if end - begin == 1 and self.is_trivial(self.states[begin]):
                    self.x[self.states[begin]] = self.best(self.states[begin], False)
                    self.y[self.states[begin]] = min(self.best(self.states[begin], True),
                                                     self.limit)
                    self.start(self.component + 1)
                elif self.sweep(begin, end):
                    self.start(self.component + 1)
                elif self.sweeps >= self.most or self.guess > 1e9:
                    self.failed = True
                    for i in range(begin, end):
                        self.y[self.states[i]] = self.limit
                    self.start(self.component + 1)
        return self.component == self.starts.shape[0] - 1

    def policy(self) -> Int64s:
        """The best row of each state: by the lower bounds to maximise, by the upper ones to minimise.
        """
        cdef int64_t n = self.groups.shape[0] - 1, s, r
        cdef int64_t[::1] out = np.empty(n, np.int64)
        cdef double value, found
        cdef double* x = &self.x[0] if self.maximise else &self.y[0]
        with nogil:
            for s in range(n):
                out[s] = -1
                found = -INFINITY if self.maximise else INFINITY
                for r in range(self.groups[s], self.groups[s + 1]):
                    value = self.low[r] + expectation(self.rows.rows, r, x, self.rows.greatest,
                                                      not self.maximise)
                    if out[s] < 0 or (value > found if self.maximise else value < found):
                        out[s], found = r, value
        return np.asarray(out)
