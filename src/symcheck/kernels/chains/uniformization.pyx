# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products of a uniformised chain, with what a stopping test needs gathered on the way."""

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t


def steps(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
          const double[::1] diagonal, double[::1] y, double[::1] z, double[::1] total,
          const double[::1] weights, double floor):
    """For each weight w: total += w y, then y <- P y, with P given by off-diagonal rows and a
    diagonal. y and z swap roles.

    Returns (result in y?, least ratio, greatest ratio, greatest entry) of the last step. The result
    is in y if the number of weights is even, else in z. The ratios are of (P y)_i to y_i; with a
    floor f they are of (P y)_i - f to y_i, where y_i > f, and of (P y)_i + f to y_i + f: bounds for
    y without its entries below f, and for y + f, if P does not enlarge constants.
    """
    cdef int64_t n = y.shape[0], i, k, t, count = weights.shape[0]
    cdef double w, s, least = 1.0, greatest = 1.0, most = 0.0, r
    cdef double* a = &y[0]
    cdef double* b = &z[0]
    cdef double* c
    cdef const double* v = &data[0] if data.shape[0] else NULL
    cdef const int32_t* idx = &indices[0] if indices.shape[0] else NULL
    cdef const int64_t* ptr = &indptr[0]
    with nogil:
        for t in range(count):
            w = weights[t]
            if w != 0.0:
                for i in range(n):
                    s = diagonal[i] * a[i]
                    for k in range(ptr[i], ptr[i + 1]):
                        s = s + v[k] * a[idx[k]]
                    total[i] += w * a[i]
                    b[i] = s
            else:
                for i in range(n):
                    s = diagonal[i] * a[i]
                    for k in range(ptr[i], ptr[i + 1]):
                        s = s + v[k] * a[idx[k]]
                    b[i] = s
            if t == count - 1:
                least = INFINITY
                greatest = 0.0
                for i in range(n):
                    if a[i] > floor:
                        r = (b[i] - floor) / a[i]
                        if r < least:
                            least = r
                    if a[i] + floor > 0.0:
                        r = (b[i] + floor) / (a[i] + floor)
                        if r > greatest:
                            greatest = r
                    elif b[i] > 0.0:
                        greatest = INFINITY
                    if b[i] > most:
                        most = b[i]
            c = a
            a = b
            b = c
    return count % 2 == 0, least, greatest, most
