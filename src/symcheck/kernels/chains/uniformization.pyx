# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Steps of a uniformised chain, with the data of a stopping test."""

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t


def uniformized_steps(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                      const double[::1] diagonal, double[::1] y, double[::1] z, double[::1] total,
                      const double[::1] weights, double floor) -> tuple[bool, float, float, float]:
    """For each weight w: total += w y, then y = P y.

    Args:
        indptr, indices, data, diagonal: P, by its rows without the diagonal, and the diagonal.
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
    cdef int64_t n = y.shape[0], i, k, t, count = weights.shape[0]
    cdef double w, product, least = 1.0, greatest = 1.0, largest = 0.0, ratio
    cdef double* current = &y[0]
    cdef double* following = &z[0]
    cdef double* swapped
    cdef const double* values = &data[0] if data.shape[0] else NULL
    cdef const int32_t* columns = &indices[0] if indices.shape[0] else NULL
    cdef const int64_t* row_ptr = &indptr[0]
    with nogil:
        for t in range(count):
            w = weights[t]
            for i in range(n):
                product = diagonal[i] * current[i]
                for k in range(row_ptr[i], row_ptr[i + 1]):
                    product = product + values[k] * current[columns[k]]
                following[i] = product
                if w != 0.0:
                    total[i] += w * current[i]
            if t == count - 1:
                least = INFINITY
                greatest = 0.0
                for i in range(n):
                    if current[i] > floor:
                        ratio = (following[i] - floor) / current[i]
                        if ratio < least:
                            least = ratio
                    if current[i] + floor > 0.0:
                        ratio = (following[i] + floor) / (current[i] + floor)
                        if ratio > greatest:
                            greatest = ratio
                    elif following[i] > 0.0:
                        greatest = INFINITY
                    if following[i] > largest:
                        largest = following[i]
            swapped = current
            current = following
            following = swapped
    return count % 2 == 0, least, greatest, largest
