# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Steps of a uniformised Markov automaton: a jump, and the choices that take no time before it."""

from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.arrays import Floats, Int64s


cdef enum:
    MOST_SWEEPS = 100000    # through a cycle of choices that take no time

cdef double SETTLED = 1e-15  # the relative change of a sweep at which a cycle is left


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
            total: float64[n], zeros, receives the sum of mass times values.
            average: float64[n], zeros, receives the sum of tail times values.
        """
        cdef int64_t k, i, n = x.shape[0], m = self.timed.shape[0], jumps = masses.shape[0]
        cdef int64_t s
        cdef double w, t
        cdef double[::1] z = total.copy()
        with nogil:
            for k in range(jumps):
                self._resolve(&x[0], maximise, &policy[0], fixed, start)
                w, t = masses[k], tails[k]
                if w > 0.0:
                    for i in range(n):
                        total[i] += w * x[i]
                if not fixed and t > 0.0:
                    for i in range(n):
                        average[i] += t * x[i]
                if k + 1 < jumps:
                    for i in range(m):
                        s = self.timed[i]
                        z[i] = (self.move[s] * share * self._sum(&x[0], self.groups[s])
                                + (self.stay[s] + self.move[s] * (1.0 - share)) * x[s])
                    for i in range(m):
                        x[self.timed[i]] = z[i]

    cdef inline double _sum(self, const double* x, int64_t r) noexcept nogil:
        cdef double total = self.constant[r]
        cdef int64_t k
        for k in range(self.indptr[r], self.indptr[r + 1]):
            total = total + self.data[k] * x[self.indices[k]]
        return total
