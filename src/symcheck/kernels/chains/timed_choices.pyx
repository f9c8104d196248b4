# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Steps of a uniformised Markov automaton: a jump, and the choices that take no time before it."""

from libc.stdint cimport int32_t, int64_t

import numpy as np

from symcheck.kernels.arrays import Floats, Int64s


cdef enum:
    MOST_SWEEPS = 100000    # through a cycle of choices that take no time
    BLOCK = 64              # states whose coefficients are computed at once

cdef double SETTLED = 1e-15  # the relative change of a sweep at which a cycle is left
cdef double ROUNDING = 1.78e-15  # 16 u, relative to a value: gains of less count as an error


cdef class TimedChoices:
    """A Markov automaton whose jumps are those of a Poisson process.

    Args:
        indptr, indices, data: the probabilities of the rows.
        groups: int64[n+1], the rows of each state.
        constant: float64[rows], what a row earns.
        leave: float64[rows], the probability of successors that are not among the states.
        move: float64[n], the probability that a jump of the process is one of the state; the states
            that take no time have any.
        stay: float64[n], 1 - move.
        timed: int32[], the states that take time; each has one row.
        order: int32[], the other states, in blocks: a successor is in the same block or before.
        ends: int64[], where each block ends.
    """

    cdef const int64_t[::1] indptr, groups, ends
    cdef const int32_t[::1] indices, timed, order
    cdef const double[::1] data, constant, leave, move, stay

    def __cinit__(self, const int64_t[::1] indptr, const int32_t[::1] indices,
                  const double[::1] data, const int64_t[::1] groups, const double[::1] constant,
                  const double[::1] leave, const double[::1] move, const double[::1] stay,
                  const int32_t[::1] timed, const int32_t[::1] order, const int64_t[::1] ends):
        self.indptr, self.indices, self.data, self.groups = indptr, indices, data, groups
        self.constant, self.leave, self.move, self.stay = constant, leave, move, stay
        self.timed, self.order, self.ends = timed, order, ends

    cdef inline double _row(self, const double* x, int64_t r, int64_t s) noexcept nogil:
        """The value of a row of a state, which is entered again until it is left."""
        cdef double total = self.constant[r], loop = 0.0, rest
        cdef int64_t k
        for k in range(self.indptr[r], self.indptr[r + 1]):
            if self.indices[k] == s:
                loop = loop + self.data[k]
            else:
                total = total + self.data[k] * x[self.indices[k]]
        if loop > 0.0:
            rest = self.leave[r]
            for k in range(self.indptr[r], self.indptr[r + 1]):
                if self.indices[k] != s:
                    rest = rest + self.data[k]
            total = total / rest
        return total

    cdef double _choose(self, const double* x, int64_t s, bint maximise, int64_t* policy,
                        bint fixed) noexcept nogil:
        """The value of the best row of a state, or of that of the policy."""
        cdef int64_t r, first = self.groups[s], best = first
        cdef double value, chosen
        if fixed:
            return self._row(x, policy[s], s)
        chosen = self._row(x, first, s)
        for r in range(first + 1, self.groups[s + 1]):
            value = self._row(x, r, s)
            if value > chosen if maximise else value < chosen:
                chosen = value
                best = r
        policy[s] = best
        return chosen

    cdef void _resolve(self, double* x, bint maximise, int64_t* policy, bint fixed,
                       double start) noexcept nogil:
        """The values of the states that take no time, from those of the others.

        A cycle is iterated from the value `start`, from below or above: each sweep is a bound.
        """
        cdef int64_t i, b, begin = 0, sweep
        cdef double value, change
        cdef bint settled
        for b in range(self.ends.shape[0]):
            if self.ends[b] == begin + 1:
                i = self.order[begin]
                x[i] = self._choose(x, i, maximise, policy, fixed)
            else:
                for i in range(begin, self.ends[b]):
                    x[self.order[i]] = start
                for sweep in range(MOST_SWEEPS):
                    settled = True
                    for i in range(begin, self.ends[b]):
                        value = self._choose(x, self.order[i], maximise, policy, fixed)
                        change = value - x[self.order[i]]
                        settled = settled and -SETTLED * value <= change <= SETTLED * value
                        x[self.order[i]] = value
                    if settled:
                        break
            begin = self.ends[b]

    def resolve(self, double[::1] x, bint maximise, int64_t[::1] policy, double start):
        """Set the values of the states that take no time, and write the best rows to the policy.

        Args:
            x: float64[n], the values; those of the states that take time are read.
            maximise: take the greatest values.
            policy: int64[n], receives the rows.
            start: where cycles are iterated from: 0 for lower bounds, or more than any value.
        """
        with nogil:
            self._resolve(&x[0], maximise, &policy[0], False, start)

    def advance(self, double[::1] x, const double[::1] masses, const double[::1] tails,
                double share, bint maximise, int64_t[::1] policy, bint fixed, double start,
                double[::1] total, double[::1] average):
        """The values after a random number of jumps.

        Args:
            x: float64[n], the values before; overwritten.
            masses, tails: float64[m], the probability of k jumps, and of more than k.
            share: of the jumps, those that are as `move` says; the others change nothing.
            maximise: whether the best row is the greatest.
            policy: int64[n], the row of each state if `fixed`, or else an array for the best ones.
            start: as in `resolve`.
            total: float64[n], receives the sum of mass times values, for states that take time.
            average: float64[n], receives the sum of tail times values likewise.
        """
        cdef int64_t k, i, m = self.timed.shape[0], jumps = masses.shape[0]
        cdef int64_t s
        cdef double w, t
        cdef double[::1] z = total.copy()
        with nogil:
            for k in range(jumps):
                self._resolve(&x[0], maximise, &policy[0], fixed, start)
                w, t = masses[k], tails[k]
                if w > 0.0:
                    for i in range(m):
                        total[self.timed[i]] += w * x[self.timed[i]]
                if not fixed and t > 0.0:
                    for i in range(m):
                        average[self.timed[i]] += t * x[self.timed[i]]
                if k + 1 < jumps:
                    for i in range(m):
                        s = self.timed[i]
                        z[i] = (self.move[s] * share * self._sum(&x[0], self.groups[s])
                                + (self.stay[s] + self.move[s] * (1.0 - share)) * x[s])
                    for i in range(m):
                        x[self.timed[i]] = z[i]

    def follow(self, double[::1] x, const double[::1] masses, const double[:, ::1] basis,
               bint maximise, int64_t[::1] policy, double[::1] total, double[::1] gain):
        """The values of a policy after a random number of jumps, and what other rows would gain.

        The values after k jumps are coefficients of powers of time; the best rows are found for
        each coefficient of a Bernstein polynomial instead, and so are at least as good at all times
        of the interval.

        Args:
            x: float64[n], the values before; overwritten by those after all jumps.
            masses: float64[count], the probability of k jumps.
            basis: float64[count, count], the Bernstein coefficients of each t^k / k!, lower
                triangular.
            maximise: whether the best row is the greatest.
            policy: int64[n], the row of each state.
            total: float64[n], receives the sum of mass times values, as above.
            gain: float64[n], zeros, receives the sum of the coefficients of what is gained; those
                that are less than 16 u times the value are left out.
        """
        cdef int64_t n = x.shape[0], m = self.timed.shape[0], count = masses.shape[0]
        cdef int64_t i, j, k, r, s
        cdef double[:, ::1] powers = np.empty((count + 1, m)), later = np.empty((BLOCK, count))
        cdef double[:, ::1] values = np.empty((n, count))
        cdef double[::1] rows = np.empty(count), one = np.sum(basis, axis=1)
        cdef double* row = &rows[0]
        cdef double* v
        cdef double change, more
        with nogil:
            for k in range(count):
                for i in range(m):
                    powers[k, i] = x[self.timed[i]]
                    total[self.timed[i]] += masses[k] * powers[k, i]
                self._resolve(&x[0], maximise, &policy[0], True, 0.0)
                for i in range(m):
                    s = self.timed[i]
                    powers[count, i] = (self.move[s] * self._sum(&x[0], self.groups[s])
                                        + self.stay[s] * x[s])
                for i in range(m):
                    x[self.timed[i]] = powers[count, i]
            for i in range((m + BLOCK - 1) // BLOCK):
                self._transform(powers, 0, i * BLOCK, basis, later)
                for j in range(min(BLOCK, m - i * BLOCK)):
                    v = &values[self.timed[i * BLOCK + j], 0]
                    for k in range(count):
                        v[k] = later[j, k]
            for i in range(self.order.shape[0]):
                s = self.order[i]
                v = &values[s, 0]
                self._coefficients(values, one, self.groups[s], s, v)
                for r in range(self.groups[s] + 1, self.groups[s + 1]):
                    self._coefficients(values, one, r, s, row)
                    if maximise:
                        for k in range(count):
                            v[k] = row[k] if row[k] > v[k] else v[k]
                    else:
                        for k in range(count):
                            v[k] = row[k] if row[k] < v[k] else v[k]
            for i in range((m + BLOCK - 1) // BLOCK):
                self._transform(powers, 1, i * BLOCK, basis, later)
                for j in range(min(BLOCK, m - i * BLOCK)):
                    s = self.timed[i * BLOCK + j]
                    v = &values[s, 0]
                    self._coefficients(values, one, self.groups[s], -1, row)
                    more = 0.0
                    for k in range(count):
                        change = self.move[s] * row[k] + self.stay[s] * v[k] - later[j, k]
                        change = change if maximise else -change
                        more = more + (change if change > ROUNDING * later[j, k] else 0.0)
                    gain[s] = more

    cdef void _transform(self, const double[:, ::1] powers, int64_t shift, int64_t begin,
                         const double[:, ::1] basis, double[:, ::1] out) noexcept nogil:
        """The Bernstein coefficients of a block of states from `begin` on."""
        cdef int64_t i, j, k, size = min(BLOCK, powers.shape[1] - begin)
        cdef double weight
        cdef const double* power
        cdef double[BLOCK] sums
        for i in range(basis.shape[0]):
            for j in range(size):
                sums[j] = 0.0
            for k in range(i + 1):
                weight = basis[i, k]
                power = &powers[k + shift, begin]
                for j in range(size):
                    sums[j] = sums[j] + weight * power[j]
            for j in range(size):
                out[j, i] = sums[j]

    cdef inline void _coefficients(self, const double[:, ::1] values, const double[::1] one,
                                   int64_t r, int64_t s, double* out) noexcept nogil:
        """The coefficients of a row; if `s` is not negative, it is entered again until left."""
        cdef int64_t i, k, t, count = one.shape[0]
        cdef double weight = self.constant[r], loop = 0.0, rest
        cdef const double* v
        for i in range(count):
            out[i] = weight * one[i]
        for k in range(self.indptr[r], self.indptr[r + 1]):
            t = self.indices[k]
            weight = self.data[k]
            if t == s:
                loop = loop + weight
            else:
                v = &values[t, 0]
                for i in range(count):
                    out[i] = out[i] + weight * v[i]
        if loop > 0.0:
            rest = self.leave[r]
            for k in range(self.indptr[r], self.indptr[r + 1]):
                if self.indices[k] != s:
                    rest = rest + self.data[k]
            for i in range(count):
                out[i] = out[i] / rest

    cdef inline double _sum(self, const double* x, int64_t r) noexcept nogil:
        cdef double total = self.constant[r]
        cdef int64_t k
        for k in range(self.indptr[r], self.indptr[r + 1]):
            total = total + self.data[k] * x[self.indices[k]]
        return total
