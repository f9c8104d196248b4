# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Sweeps for stationary distributions of a chain given by its rates, loops left out, and what else equations are improved with."""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t


def outflow(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data):
    """Sum of each row without its loop."""
    cdef int64_t n = indptr.shape[0] - 1, i, k
    cdef double[::1] out = np.zeros(n)
    cdef long double total
    with nogil:
        for i in range(n):
            total = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] != i:
                    total = total + data[k]
            out[i] = <double>total
    return np.asarray(out)


def flow_sweep(const int64_t[::1] start, const int32_t[::1] sources, const double[::1] data, const double[::1] leave,
               double[::1] pi):
    """One Gauss-Seidel sweep on pi Q = 0 (rows are columns of Q), forwards and backwards; returns the greatest change."""
    cdef int64_t n = pi.shape[0], j, i, k, t
    cdef double total, change = 0.0
    with nogil:
        for t in range(2):
            change = 0.0
            for j in range(n):
                i = j if t == 0 else n - 1 - j
                total = 0.0
                for k in range(start[i], start[i + 1]):
                    if sources[k] != i:
                        total = total + data[k] * pi[sources[k]]
                total = total / leave[i]
                if fabs(total - pi[i]) > change:
                    change = fabs(total - pi[i])
                pi[i] = total
    return change


def push_sweep(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const double[::1] leave,
               double[::1] mass, double[::1] time):
    """Let the mass of each state in turn spend its time there and move on, forwards and backwards: no columns are needed."""
    cdef int64_t n = mass.shape[0], i, j, k, t
    cdef double share
    with nogil:
        for t in range(2):
            for j in range(n):
                i = j if t == 0 else n - 1 - j
                share = mass[i] / leave[i]
                if share == 0.0:
                    continue
                mass[i] = 0.0
                time[i] += share
                for k in range(indptr[i], indptr[i + 1]):
                    if indices[k] != i:
                        mass[indices[k]] += share * data[k]


def generator_times(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const double[::1] x,
                    double[::1] out):
    """out = Q x, as sums of differences: rate * (x_j - x_i), so that constants in x leave nothing behind."""
    cdef int64_t n = x.shape[0], i, k
    cdef double total, own
    cdef const double* v = &data[0]
    cdef const int32_t* idx = &indices[0]
    cdef const double* y = &x[0]
    with nogil:
        for i in range(n):
            total = 0.0
            own = y[i]
            for k in range(indptr[i], indptr[i + 1]):
                total = total + v[k] * (y[idx[k]] - own)
            out[i] = total


def largest_flow(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const double[::1] x):
    """The greatest sum of rate * |x_j - x_i| over the states: what rounding in Q x is relative to."""
    cdef int64_t n = x.shape[0], i, k
    cdef double total, most = 0.0
    with nogil:
        for i in range(n):
            total = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                total = total + data[k] * fabs(x[indices[k]] - x[i])
            if total > most:
                most = total
    return most
