# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Steps of a uniformised chain, with the data of a stopping test."""

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.rows.row_product cimport add_row_product


cdef void multiply_rows(const int64_t[::1] indptr, const int32_t[::1] indices,
                        const double[::1] values, const double[::1] diagonal,
                        const double* current, double* following, double* total, double w,
                        int64_t first, int64_t end) noexcept nogil:
    """following = P current and total += w current, in the rows `first` to `end` - 1."""
    cdef int64_t i
    cdef const double* value = &values[0] if values.shape[0] else NULL
    cdef const int32_t* columns = &indices[0] if indices.shape[0] else NULL
    for i in range(first, end):
        following[i] = add_row_product(diagonal[i] * current[i], columns, value, current, indptr[i],
                                       indptr[i + 1])
        if w != 0.0:
            total[i] += w * current[i]


def uniformized_rows(const int64_t[::1] indptr, const int32_t[::1] indices,
                     const double[::1] values, const double[::1] diagonal,
                     const double[::1] y, double[::1] z, double[::1] total, double weight,
                     int64_t first, int64_t end):
    """z = P y and total += weight y, in the rows `first` to `end` - 1; see `uniformized_steps`."""
    with nogil:
        multiply_rows(indptr, indices, values, diagonal, &y[0], &z[0], &total[0], weight,
                      first, end)


def step_ratios(const double[::1] y, const double[::1] z, double floor
                ) -> tuple[float, float, float]:
    """The ratios of a step from y to z, and the greatest entry of z; see `uniformized_steps`."""
    cdef int64_t i, n = y.shape[0]
    cdef double least = INFINITY, greatest = 0.0, largest = 0.0, ratio
    with nogil:
        for i in range(n):
            if y[i] > floor:
                ratio = (z[i] - floor) / y[i]
                if ratio < least:
                    least = ratio
            if y[i] + floor > 0.0:
                ratio = (z[i] + floor) / (y[i] + floor)
                if ratio > greatest:
                    greatest = ratio
            elif z[i] > 0.0:
                greatest = INFINITY
            if z[i] > largest:
                largest = z[i]
    return least, greatest, largest


def uniformized_steps(const int64_t[::1] indptr, const int32_t[::1] indices,
                      const double[::1] values, const double[::1] diagonal,
                      double[::1] y, double[::1] z, double[::1] total, const double[::1] weights,
                      double floor) -> tuple[bool, float, float, float]:
    """For each weight w: total += w y, then y = P y.

    Args:
        indptr, indices, values, diagonal: P, by its rows without the diagonal, and the diagonal.
        y, z: float64[n], the vector and scratch; they swap their roles in each step.
        total: float64[n], receives the weighted sum.
        weights: float64[steps].
        floor: f, see below.
    Returns:
        in_y: whether the result is in y (for an even number of steps), else in z.
        least, greatest: ratios of the last step. With floor f, `least` is that of (P y)_i - f to
            y_i where y_i > f, and `greatest` that of (P y)_i + f to y_i + f. They are bounds for y
            without its entries below f, and for y + f, if P does not enlarge constants.
        largest: the greatest entry of P y.
    """
    cdef int64_t n = y.shape[0], t, count = weights.shape[0]
    cdef double* current = &y[0]
    cdef double* following = &z[0]
    if count == 0:
        return True, 1.0, 1.0, 0.0
    with nogil:
        for t in range(count):
            multiply_rows(indptr, indices, values, diagonal, current, following, &total[0],
                          weights[t], 0, n)
            current, following = following, current
    return count % 2 == 0, *(step_ratios(z, y, floor) if count % 2 == 0
                             else step_ratios(y, z, floor))


def active_steps(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] rates,
                 const double[::1] exit_rates, double q, const double[::1] rewards, double[::1] y,
                 double[::1] z, int32_t[::1] arrivals, int32_t[::1] active, int32_t[::1] following,
                 int64_t count, double threshold, double[::1] values, double[::1] lost
                 ) -> tuple[int, int, int]:
    """Replace the distribution y by y P in each step, on the states that hold probability.

    Args:
        indptr, indices, rates, exit_rates, q: P = I + Q/q, by the rates, the exit rates, which
            include self-loops, and the uniformisation rate.
        rewards: float64[n].
        y: float64[n], the distribution, 0 outside of active states.
        z, arrivals: float64[n] and int32[n], scratch, 0 before and afterwards.
        active, following: int32[capacity], the states where y is positive, and scratch.
        count: the number of active states.
        threshold: smaller probabilities are dropped before a step.
        values, lost: float64[an even number of steps], receive y·rewards before each step, and
            the probability that was dropped in that step.
    Returns:
        The number of active states, -1 if they exceed the capacity; the entries visited; and the
        largest number of terms of a probability.
    """
    cdef int64_t t, a, k, made, visited = 0, capacity = active.shape[0]
    cdef int32_t s, target, terms = 0
    cdef double p, value, dropped, stay
    cdef double* current = &y[0]
    cdef double* other = &z[0]
    cdef double* swapped
    cdef int32_t* states = &active[0]
    cdef int32_t* others = &following[0]
    cdef int32_t* swapped_states
    with nogil:
        for t in range(values.shape[0]):
            value = dropped = 0.0
            made = 0
            for a in range(count):
                s = states[a]
                p = current[s]
                current[s] = 0.0
                value += p * rewards[s]
                if p < threshold:
                    dropped += p
                    continue
                if made + indptr[s + 1] - indptr[s] + 1 > capacity:
                    made = -1
                    break
                stay = (q - exit_rates[s]) / q  # with a relative error only
                if stay > 0.0:
                    if arrivals[s] == 0:
                        others[made] = s
                        made += 1
                    arrivals[s] += 1
                    other[s] += stay * p
                for k in range(indptr[s], indptr[s + 1]):
                    target = indices[k]
                    if arrivals[target] == 0:
                        others[made] = target
                        made += 1
                    arrivals[target] += 1
                    other[target] += rates[k] / q * p
                visited += indptr[s + 1] - indptr[s] + 1
            values[t] = value
            lost[t] = dropped
            count = made
            if count < 0:
                break
            for a in range(count):
                if arrivals[others[a]] > terms:
                    terms = arrivals[others[a]]
                arrivals[others[a]] = 0
            swapped = current
            current = other
            other = swapped
            swapped_states = states
            states = others
            others = swapped_states
    return count, visited, terms
