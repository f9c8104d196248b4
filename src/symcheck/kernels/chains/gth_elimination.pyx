# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Grassmann-Taksar-Heyman elimination: the states of a chain are eliminated without a subtraction.

The diagonal of a state is the sum of what leaves it, so every operation acts on positive numbers,
and each entry of the result has a small relative error, however slowly the chain mixes. Each
elimination changes the entries of the rows that it updates by at most 5 roundings, relatively. As
every spanning forest of the chain takes one edge per state, this moves each entry of the solution
by at most 10 roundings per updated row. Sources: Grassmann, Taksar & Heyman (1985); O'Cinneide
(1993).
"""

import numpy as np

from libc.float cimport DBL_MAX, DBL_MIN
from libc.math cimport frexp, ldexp
from libc.stdint cimport int32_t, int64_t
from libc.stdlib cimport calloc, free, realloc

from symcheck.kernels.portable cimport (COMPENSATED_ROUNDINGS, Sum, add_product, add_term, divided,
                                        in_range, is_positive, product_underflows, rounded, sum_of)
from symcheck.kernels.rounding cimport UNIT_ROUNDOFF
from symcheck.kernels.tuning cimport FILL_IN_CLASSES


cdef enum:
    LEAST_POWER = -(1 << 30)  # of 2; below that of every weight


cdef struct SparseRow:
    int32_t* indices
    double* data
    int32_t size, capacity


cdef inline int append_entry(SparseRow* row, int32_t i, double v, bint with_values) noexcept nogil:
    """Append an entry to a row; 1 when memory ends."""
    cdef int32_t capacity
    if row.size == row.capacity:
        capacity = row.capacity * 2 if row.capacity else 4
        row.indices = <int32_t*>realloc(row.indices, capacity * sizeof(int32_t))
        if with_values:
            row.data = <double*>realloc(row.data, capacity * sizeof(double))
        if row.indices == NULL or (with_values and row.data == NULL):
            return 1
        row.capacity = capacity
    row.indices[row.size] = i
    if with_values:
        row.data[row.size] = v
    row.size += 1
    return 0


cdef class GthElimination:
    """Factors of I - A, for substochastic (or scaled) A with the mass `exit` leaving each row.

    Args:
        indptr, indices, data: int64[n+1], int32, float64: A. Its diagonal is ignored.
        exit: float64[n].
        limit: most operations.
    Raises:
        MemoryError: memory ended.

    complete: False if the elimination stopped, because `limit` was reached, a state cannot leave,
    or numbers became subnormal. error: bound on the relative error of each entry of a solution with
    a non-negative right-hand side. out_of_range: whether an entry left the range of normal doubles,
    for which the bound does not hold. operations, updates: work done.
    """

    cdef SparseRow* rows           # the first of the three arrays, which are allocated together
    cdef SparseRow* columns
    cdef SparseRow* factors
    cdef int64_t n
    cdef int64_t[::1] order
    cdef double[::1] pivot_sum, exit_mass
    cdef public double error
    cdef public bint complete, out_of_range
    cdef public int64_t operations, updates

    def __cinit__(self, const int64_t[::1] indptr, const int32_t[::1] indices,
                  const double[::1] data, const double[::1] exit, int64_t limit):
        cdef int64_t n = indptr.shape[0] - 1, i, k
        self.n = n
        self.order = np.empty(n, dtype=np.int64)
        self.pivot_sum = np.zeros(n)
        self.exit_mass = np.array(exit)
        self.rows = <SparseRow*>calloc(3 * n + 1, sizeof(SparseRow))
        if self.rows == NULL:
            raise MemoryError
        self.columns = self.rows + n
        self.factors = self.columns + n
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] != i:
                    append_entry(&self.rows[i], indices[k], data[k], True)
                    append_entry(&self.columns[indices[k]], <int32_t>i, 0.0, False)
        self.out_of_range = False
        self.complete = self.eliminate_all(limit) == 0 and not self.out_of_range
        self.error = (10.0 * self.updates + (10.0 + COMPENSATED_ROUNDINGS) * n + 20.0) * UNIT_ROUNDOFF

    def __dealloc__(self):
        cdef int64_t i
        for i in range(3 * self.n if self.rows != NULL else 0):
            free(self.rows[i].indices)
            free(self.rows[i].data)
        free(self.rows)

    cdef int eliminate_all(self, int64_t limit) except -1:
        """Eliminate all states, those with the least fill-in (in-degree times out-degree) first; 1
        if it stopped.
        """
        cdef int64_t n = self.n, done = 0, fill_in_class, class_, b, i
        cdef int64_t classes = FILL_IN_CLASSES
        cdef int32_t k, p
        cdef SparseRow* neighbours
        cdef int side
        # Doubly linked lists of the states of each class.
        cdef int32_t[::1] first_state = np.full(classes, -1, dtype=np.int32)
        cdef int32_t[::1] next_state = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] previous_state = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] class_of = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] position = np.full(n, -1, dtype=np.int32)
        cdef int status = 0
        with nogil:
            for i in range(n):
                link(<int32_t>i, self.fill_in_class(i, classes), first_state, next_state,
                     previous_state, class_of)
            class_ = 0
            while done < n:
                while class_ < classes and first_state[class_] < 0:
                    class_ += 1
                k = first_state[class_]
                unlink(k, first_state, next_state, previous_state, class_of)
                self.order[done] = k
                done += 1
                status = self.eliminate_state(k, position, done == n)
                if status != 0 or self.out_of_range or self.operations > limit:
                    status = 1
                    break
                # The degrees of the neighbours of k have changed.
                for side in range(2):
                    neighbours = &self.rows[k] if side else &self.factors[k]
                    for i in range(neighbours.size):
                        p = neighbours.indices[i]
                        unlink(p, first_state, next_state, previous_state, class_of)
                        b = self.fill_in_class(p, classes)
                        link(p, b, first_state, next_state, previous_state, class_of)
                        class_ = min(class_, b)
        return status

    cdef int64_t fill_in_class(self, int64_t i, int64_t classes) noexcept nogil:
        """The expected fill-in, on a scale that is coarser above 2048."""
        cdef int64_t fill_in = <int64_t>self.rows[i].size * self.columns[i].size
        cdef int64_t class_ = 2048
        if fill_in < class_:
            return fill_in
        while fill_in >= 2 * 2048 and class_ < classes - 64:
            fill_in >>= 1
            class_ += 64
        class_ += (fill_in - 2048) >> 5
        return class_ if class_ < classes else classes - 1

    cdef int eliminate_state(self, int32_t k, int32_t[::1] position, bint last) noexcept nogil:
        """Eliminate a state; 1 if it cannot leave, or when memory ends."""
        cdef SparseRow* row = &self.rows[k]
        cdef SparseRow* other
        cdef int32_t e, m, i, j, entry_of_k
        cdef double factor
        cdef Sum pivot_sum = sum_of(self.exit_mass[k])
        for e in range(row.size):
            pivot_sum = add_term(pivot_sum, row.data[e])
        self.pivot_sum[k] = rounded(pivot_sum)
        if not is_positive(pivot_sum):
            return 0 if last else 1
        # Remove k from the columns of its successors.
        for e in range(row.size):
            other = &self.columns[row.indices[e]]
            for m in range(other.size):
                if other.indices[m] == k:
                    other.size -= 1
                    other.indices[m] = other.indices[other.size]
                    break
            self.operations += other.size
        for m in range(self.columns[k].size):
            i = self.columns[k].indices[m]
            other = &self.rows[i]
            entry_of_k = -1
            for e in range(other.size):
                position[other.indices[e]] = e
                if other.indices[e] == k:
                    entry_of_k = e
            factor = other.data[entry_of_k] / self.pivot_sum[k]
            if append_entry(&self.factors[k], i, factor, True):
                return 1
            # A normal sum has lost at most a rounding, even if its terms are subnormal.
            self.exit_mass[i] += factor * self.exit_mass[k]
            if factor < DBL_MIN or (self.exit_mass[i] < DBL_MIN and self.exit_mass[k] > 0.0):
                self.out_of_range = True
            for e in range(row.size):
                j = row.indices[e]
                if j == i:
                    continue
                if position[j] >= 0:
                    other.data[position[j]] += factor * row.data[e]
                else:
                    position[j] = other.size
                    if (append_entry(other, j, factor * row.data[e], True)
                            or append_entry(&self.columns[j], i, 0.0, False)):
                        return 1
                if other.data[position[j]] < DBL_MIN:
                    self.out_of_range = True
            for e in range(other.size):
                position[other.indices[e]] = -1
            other.size -= 1
            other.indices[entry_of_k] = other.indices[other.size]
            other.data[entry_of_k] = other.data[other.size]
            self.updates += 1
            self.operations += row.size + 2 * other.size
        free(self.columns[k].indices)
        self.columns[k].indices = NULL
        self.columns[k].size = 0
        self.columns[k].capacity = 0
        return 0

    def solve(self, const double[::1] b) -> Floats:
        """The solution of x = A x + b for b >= 0 (float64[n]): float64[n].

        Each entry has a relative error of at most `error`; it is infinite if the state never
        leaves. `out_of_range` says afterwards whether that does not hold.
        """
        cdef int64_t n = self.n, i, e
        cdef int32_t k, p
        cdef double[::1] x = np.array(b)
        cdef double before
        cdef Sum pivot_sum
        with nogil:
            for i in range(n):
                k = <int32_t>self.order[i]
                if x[k] == 0.0:
                    continue
                for e in range(self.factors[k].size):
                    p = self.factors[k].indices[e]
                    before = x[p]
                    x[p] += self.factors[k].data[e] * x[k]
                    if x[p] < DBL_MIN or (x[p] > DBL_MAX >= x[k] and before <= DBL_MAX):
                        self.out_of_range = True
            for i in range(n - 1, -1, -1):
                k = <int32_t>self.order[i]
                pivot_sum = sum_of(x[k])
                for e in range(self.rows[k].size):
                    p = self.rows[k].indices[e]
                    pivot_sum = add_product(pivot_sum, self.rows[k].data[e], x[p])
                    if product_underflows(self.rows[k].data[e], x[p]):
                        self.out_of_range = True
                x[k] = divided(pivot_sum, self.pivot_sum[k])
                if (is_positive(pivot_sum)
                        and (x[k] < DBL_MIN or (x[k] > DBL_MAX and in_range(pivot_sum)))):
                    self.out_of_range = True
        return np.asarray(x)

    def stationary(self) -> Floats:
        """The stationary distribution of a chain that nothing leaves: float64[n], with sum 1.

        Each entry that is a normal double has a relative error of at most `error`. Weights are
        kept as fractions times powers of 2, because those of a chain with drift leave the range of
        doubles, which the probabilities need not do.
        """
        cdef int64_t n = self.n, i, e
        cdef int32_t k, p
        cdef int power, fraction_power
        cdef int64_t greatest
        cdef double[::1] x = np.zeros(n)
        cdef int64_t[::1] powers = np.zeros(n, dtype=np.int64)
        cdef double fraction
        cdef SparseRow* factors
        cdef Sum weight
        with nogil:
            # The last state has weight 1; the weight of k comes from the states eliminated after
            # it.
            x[self.order[n - 1]] = 1.0
            for i in range(n - 2, -1, -1):
                k = <int32_t>self.order[i]
                factors = &self.factors[k]
                greatest = LEAST_POWER
                for e in range(factors.size):
                    frexp(factors.data[e], &power)
                    greatest = max(greatest, power + powers[factors.indices[e]])
                weight = sum_of(0.0)
                for e in range(factors.size):
                    p = factors.indices[e]
                    fraction = frexp(factors.data[e], &power) * x[p]
                    weight = add_term(weight, scaled(fraction, power + powers[p] - greatest))
                x[k] = frexp(rounded(weight), &fraction_power)
                powers[k] = fraction_power + greatest
            greatest = LEAST_POWER
            for i in range(n):
                greatest = max(greatest, powers[i])
            for i in range(n):
                x[i] = scaled(x[i], powers[i] - greatest)
        out = np.asarray(x)
        return out / out.sum()


cdef inline double scaled(double x, int64_t power) noexcept nogil:
    """x times a power of 2 that is at most 1; it is 0 below the range of doubles."""
    return ldexp(x, <int>power) if power > -2000 else 0.0


cdef inline void link(int32_t i, int64_t b, int32_t[::1] first_state, int32_t[::1] next_state,
                      int32_t[::1] previous_state, int32_t[::1] class_of) noexcept nogil:
    """Put a state into the list of a class."""
    next_state[i] = first_state[b]
    previous_state[i] = -1
    if first_state[b] >= 0:
        previous_state[first_state[b]] = i
    first_state[b] = i
    class_of[i] = <int32_t>b


cdef inline void unlink(int32_t i, int32_t[::1] first_state, int32_t[::1] next_state,
                        int32_t[::1] previous_state, int32_t[::1] class_of) noexcept nogil:
    """Take a state out of its list."""
    if previous_state[i] >= 0:
        next_state[previous_state[i]] = next_state[i]
    else:
        first_state[class_of[i]] = next_state[i]
    if next_state[i] >= 0:
        previous_state[next_state[i]] = previous_state[i]
