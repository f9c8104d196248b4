# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Gauss-Seidel sweeps for stationary distributions of chains, and products with the generator.

A chain is given by its rates in compressed rows (int64[n+1], int32, float64); entries on the
diagonal are ignored, except where stated. Vectors are float64[n]. `exit_rate` is positive.
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.portable cimport Sum, add_term, rounded, sum_of


def exit_rates(const int64_t[::1] indptr, const int32_t[::1] indices,
               const double[::1] data) -> Floats:
    """The sum of each row without its diagonal, rounded at most twice in all: float64[n]."""
    cdef int64_t n = indptr.shape[0] - 1, i, k
    cdef double[::1] out = np.zeros(n)
    cdef Sum total
    with nogil:
        for i in range(n):
            total = sum_of(0.0)
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] != i:
                    total = add_term(total, data[k])
            out[i] = rounded(total)
    return np.asarray(out)


def stationary_sweep(const int64_t[::1] column_ptr, const int32_t[::1] sources,
                     const double[::1] data, const double[::1] exit_rate, double[::1] pi) -> float:
    """One symmetric Gauss-Seidel sweep on pi Q = 0, in place.

    column_ptr, sources, data: the transposed rates. Returns the greatest change of the backward
    half.
    """
    cdef int64_t n = pi.shape[0], j, i, k, direction
    cdef double total, change = 0.0
    with nogil:
        for direction in range(2):
            change = 0.0
            for j in range(n):
                i = j if direction == 0 else n - 1 - j
                total = 0.0
                for k in range(column_ptr[i], column_ptr[i + 1]):
                    if sources[k] != i:
                        total = total + data[k] * pi[sources[k]]
                total = total / exit_rate[i]
                if fabs(total - pi[i]) > change:
                    change = fabs(total - pi[i])
                pi[i] = total
    return change


def occupation_sweep(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                     const double[::1] exit_rate, double[::1] mass, double[::1] time):
    """Let the mass of each state in turn spend its time there and move on, in place.

    The states are visited forwards and backwards. mass: the mass that still moves; time: the
    expected time that is accumulated. It needs rows only, no columns.
    """
    cdef int64_t n = mass.shape[0], i, j, k, direction
    cdef double time_here
    with nogil:
        for direction in range(2):
            for j in range(n):
                i = j if direction == 0 else n - 1 - j
                time_here = mass[i] / exit_rate[i]
                if time_here == 0.0:
                    continue
                mass[i] = 0.0
                time[i] += time_here
                for k in range(indptr[i], indptr[i + 1]):
                    if indices[k] != i:
                        mass[indices[k]] += time_here * data[k]


def apply_generator(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                    const double[::1] x, double[::1] out):
    """out = Q x, as sums of rate * (x_j - x_i), so that constants in x cancel exactly."""
    cdef int64_t n = x.shape[0], i, k
    cdef double total, x_i
    cdef const double* v = &data[0]
    cdef const int32_t* idx = &indices[0]
    cdef const double* y = &x[0]
    with nogil:
        for i in range(n):
            total = 0.0
            x_i = y[i]
            for k in range(indptr[i], indptr[i + 1]):
                total = total + v[k] * (y[idx[k]] - x_i)
            out[i] = total


def largest_generator_term(const int64_t[::1] indptr, const int32_t[::1] indices,
                           const double[::1] data, const double[::1] x) -> float:
    """The greatest sum of rate * |x_j - x_i| over the states, to which the rounding of Q x is
    relative.
    """
    cdef int64_t n = x.shape[0], i, k
    cdef double total, largest = 0.0
    with nogil:
        for i in range(n):
            total = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                total = total + data[k] * fabs(x[indices[k]] - x[i])
            if total > largest:
                largest = total
    return largest
