# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""SSOR preconditioning by Eisenstat's trick, with the vector operations of BiCGStab.

I - A = K1 + K2 - I, with K1 the lower and K2 the upper triangle (with unit diagonals); A =
diag(scale) R, where R has no diagonal. The product with K1^-1 (I - A) K2^-1 takes one solution with
K1 and one with K2 (Eisenstat 1981), and the vector operations of BiCGStab are done in the same
passes. count: int32[n], the entries of each row of a triangle, whose indices and values follow each
other. Vectors are float64[n].
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t

Triangle: TypeAlias = "tuple[Int32s, Int32s, Floats]"


def triangles(const int64_t[::1] indptr, const int32_t[::1] indices,
              const double[::1] data) -> tuple[Triangle, Triangle]:
    """The lower and the upper triangle of a square matrix without its diagonal.

    Returns:
        count, indices and values of each.
    """
    cdef int64_t n = indptr.shape[0] - 1, i, k, a = 0, b = 0
    cdef int32_t[::1] below = np.zeros(n, np.int32), above = np.zeros(n, np.int32)
    with nogil:
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                below[i] += indices[k] < i
                above[i] += indices[k] > i
            a += below[i]
            b += above[i]
    cdef int32_t[::1] lower = np.empty(a, np.int32), upper = np.empty(b, np.int32)
    cdef double[::1] lower_values = np.empty(a), upper_values = np.empty(b)
    a = b = 0
    with nogil:
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] < i:
                    lower[a] = indices[k]
                    lower_values[a] = data[k]
                    a += 1
                elif indices[k] > i:
                    upper[b] = indices[k]
                    upper_values[b] = data[k]
                    b += 1
    return ((np.asarray(below), np.asarray(lower), np.asarray(lower_values)),
            (np.asarray(above), np.asarray(upper), np.asarray(upper_values)))


def diagonal(const int64_t[::1] indptr, const int32_t[::1] indices,
             const double[::1] data) -> Floats:
    """The diagonal of a matrix in compressed rows: float64[n]."""
    cdef int64_t i, k, n = indptr.shape[0] - 1
    cdef double[::1] out = np.zeros(n)
    with nogil:
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] == i:
                    out[i] += data[k]
    return np.asarray(out)


cdef inline double _row_product(const int32_t* indices, const double* values, const double* x,
                                int64_t begin, int64_t end) noexcept nogil:
    """The product of a row of a triangle and x."""
    cdef double total = 0.0
    cdef int64_t k
    for k in range(begin, end):
        total = total + values[k] * x[indices[k]]
    return total


def solve_upper(const int32_t[::1] count, const int32_t[::1] indices, const double[::1] values,
                const double[::1] scale, const double[::1] r, double[::1] p, const double[::1] v, double beta, double gamma, double[::1] t):
    """p = r + beta p - gamma v, and t = K2^-1 p. p may be r."""
    cdef int64_t i, k = indices.shape[0], m
    cdef const int32_t* e = &indices[0] if k else NULL
    cdef const double* a = &values[0] if k else NULL
    with nogil:
        for i in range(count.shape[0] - 1, -1, -1):
            m = k - count[i]
            p[i] = r[i] + beta * p[i] - gamma * v[i]
            t[i] = p[i] + scale[i] * _row_product(e, a, &t[0], m, k)
            k = m


def solve_lower(const int32_t[::1] count, const int32_t[::1] indices, const double[::1] values,
                const double[::1] scale, const double[::1] v,
                const double[::1] t, double[::1] w, double[::1] out,
                const double[::1] other) -> tuple[float, float]:
    """out = t + w with w = K1^-1 (v - t), which is K1^-1 (I - A) t if v = K2 t.

    Returns (other · out, out · out).
    """
    cdef int64_t i, k = 0, m
    cdef double total, dot = 0.0, square = 0.0
    cdef const int32_t* e = &indices[0] if indices.shape[0] else NULL
    cdef const double* a = &values[0] if indices.shape[0] else NULL
    with nogil:
        for i in range(count.shape[0]):
            m = k + count[i]
            total = v[i] - t[i] + scale[i] * _row_product(e, a, &w[0], k, m)
            k = m
            w[i] = total
            total = total + t[i]
            out[i] = total
            dot = dot + other[i] * total
            square = square + total * total
    return dot, square


def update_iterate(double[::1] x, const double[::1] p, double[::1] r, const double[::1] q,
                   const double[::1] shadow, double alpha,
                   double omega) -> tuple[float, float, float]:
    """x += alpha p + omega r, then r -= omega q.

    Returns (shadow · r, r · r, greatest |r|).
    """
    cdef int64_t i
    cdef double dot = 0.0, square = 0.0, largest = 0.0, residual
    with nogil:
        for i in range(x.shape[0]):
            x[i] = x[i] + alpha * p[i] + omega * r[i]
            residual = r[i] - omega * q[i]
            r[i] = residual
            dot = dot + shadow[i] * residual
            square = square + residual * residual
            residual = fabs(residual)
            if not residual <= largest:
                largest = residual
    return dot, square, largest


def add_multiple(double[::1] y, const double[::1] z, double c,
                 const double[::1] other) -> tuple[float, float]:
    """y += c z; returns (other · y, y · y)."""
    cdef int64_t i
    cdef double dot = 0.0, square = 0.0, sum_i
    with nogil:
        for i in range(y.shape[0]):
            sum_i = y[i] + c * z[i]
            y[i] = sum_i
            dot = dot + other[i] * sum_i
            square = square + sum_i * sum_i
    return dot, square
