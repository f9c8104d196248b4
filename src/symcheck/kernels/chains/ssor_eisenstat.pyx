# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""SSOR preconditioning by Eisenstat's trick, with the vector operations of BiCGStab.

I - A = K1 + K2 - I, with K1 the lower and K2 the upper triangle (with unit diagonals); A =
diag(scale) R, where R has no diagonal. The product with K1^-1 (I - A) K2^-1 takes one solution with
K1 and one with K2 (Eisenstat 1981), and the vector operations of BiCGStab are done in the same
passes. count: int32[n], the entries of each row of a triangle, whose indices and values follow each
other. Vectors are float64[n].

The unknowns may be scaled: with D = diag(unit), the functions work on D^-1 (I - A) D, but keep t
and w multiplied by D, so that the values of R stay what they are. An empty `unit` stands for ones.
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.chains.row_blocks cimport RowBlocks
from symcheck.kernels.rows.row_product cimport add_row_product


def triangle_sizes(const int64_t[::1] indptr, const int32_t[::1] indices, int32_t[::1] lower,
                   int32_t[::1] upper) -> tuple[int, int]:
    """Count the entries below and above the diagonal in each row (int32[n] each); returns the
    totals.
    """
    cdef int64_t i, k, a = 0, b = 0
    cdef int32_t x, y
    with nogil:
        for i in range(lower.shape[0]):
            x = y = 0
            for k in range(indptr[i], indptr[i + 1]):
                x += indices[k] < i
                y += indices[k] > i
            lower[i] = x
            upper[i] = y
            a += x
            b += y
    return a, b


def fill_triangles(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] values,
                   int32_t[::1] lower_indices, double[::1] lower_values,
                   int32_t[::1] upper_indices, double[::1] upper_values):
    """Write the triangles of a matrix without its diagonal."""
    cdef int64_t i, k, a = 0, b = 0
    with nogil:
        for i in range(indptr.shape[0] - 1):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] < i:
                    lower_indices[a] = indices[k]
                    lower_values[a] = values[k]
                    a += 1
                elif indices[k] > i:
                    upper_indices[b] = indices[k]
                    upper_values[b] = values[k]
                    b += 1


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


def solve_upper(RowBlocks blocks, const int32_t[::1] count, const int32_t[::1] indices,
                const double[::1] values, const double[::1] scale, const double[::1] unit,
                const double[::1] r, double[::1] p, const double[::1] v,
                double beta, double gamma, double[::1] t):
    """p = r + beta p - gamma v, and t = D K2^-1 p. p may be r.

    The sums of `blocks` are p · p twice.
    """
    cdef int64_t i, k, m, block
    cdef bint has_units = unit.shape[0] > 0
    cdef double own, square
    cdef const int32_t* e = &indices[0] if indices.shape[0] else NULL
    cdef const double* a = &values[0] if indices.shape[0] else NULL
    with nogil:
        while (block := blocks.claim()) >= 0:
            k = blocks.starts[block + 1]
            square = 0.0
            for i in range(blocks.bounds[block + 1] - 1, blocks.bounds[block] - 1, -1):
                m = k - count[i]
                own = r[i] + beta * p[i] - gamma * v[i]
                p[i] = own
                square = square + own * own
                if has_units:
                    own = own * unit[i]
                t[i] = own + scale[i] * add_row_product(0.0, e, a, &t[0], m, k)
                k = m
            blocks.finish(block, square, square)


def solve_lower(RowBlocks blocks, const int32_t[::1] count, const int32_t[::1] indices,
                const double[::1] values, const double[::1] scale, const double[::1] unit,
                const double[::1] v, const double[::1] t, double[::1] w,
                double[::1] out, const double[::1] other):
    """out = D^-1 (t + w) with w = D K1^-1 (v - D^-1 t).

    out is K1^-1 D^-1 (I - A) t if v = K2 D^-1 t. The sums of `blocks` are other · out and
    out · out.
    """
    cdef int64_t i, k, m, block
    cdef bint has_units = unit.shape[0] > 0
    cdef double own, dot, square
    cdef const int32_t* e = &indices[0] if indices.shape[0] else NULL
    cdef const double* a = &values[0] if indices.shape[0] else NULL
    with nogil:
        while (block := blocks.claim()) >= 0:
            k = blocks.starts[block]
            dot = square = 0.0
            for i in range(blocks.bounds[block], blocks.bounds[block + 1]):
                m = k + count[i]
                own = v[i]
                if has_units:
                    own = own * unit[i]
                own = own - t[i] + scale[i] * add_row_product(0.0, e, a, &w[0], k, m)
                k = m
                w[i] = own
                own = own + t[i]
                if has_units:
                    own = own / unit[i]
                out[i] = own
                dot = dot + other[i] * own
                square = square + own * own
            blocks.finish(block, dot, square)


def update_iterate(double[::1] x, const double[::1] p, double[::1] r, const double[::1] q,
                   const double[::1] shadow, double alpha, double omega, int64_t first,
                   int64_t end) -> tuple[float, float, float]:
    """x += alpha p + omega r, then r -= omega q, in the rows `first` to `end` - 1.

    Returns (shadow · r, r · r, greatest |r|).
    """
    cdef int64_t i
    cdef double dot = 0.0, square = 0.0, largest = 0.0, residual
    with nogil:
        for i in range(first, end):
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
