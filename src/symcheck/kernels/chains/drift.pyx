# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Random paths of a chain, costs of the cheapest paths from some states, and the drift of functions.

A chain is given by its rates in compressed rows (int64[n+1], int32, float64), and the sums of the
rows, with or without self-loops, float64[n].
"""

import numpy as np

from libc.math cimport exp, log1p
from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.chains.jump_costs cimport cost_of_jump


def walk(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
         const double[::1] leaving, const double[::1] uniform, int64_t state, int64_t[::1] visits
         ) -> int:
    """A random path from `state`, with a jump for each of the numbers in `uniform`; its last state.

    leaving: the sums of the rows. uniform: float64[jumps], between 0 and 1. visits: int64[n], to
    which the visits of each state are added.
    """
    cdef int64_t i, k, last
    cdef double remaining
    with nogil:
        for i in range(uniform.shape[0]):
            visits[state] += 1
            remaining = uniform[i] * leaving[state]
            last = indptr[state + 1] - 1
            k = indptr[state]
            while k < last and remaining >= data[k]:
                remaining = remaining - data[k]
                k += 1
            state = indices[k]
    return state


def spread(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
           const double[::1] leaving, const int32_t[::1] order, double[::1] cost) -> bool:
    """Lower the costs of the successors of some states in turn, in place; whether any that had had
    its turn became less.

    order: int32[k], the states. cost: float64[n], of the cheapest known path from where it is 0.
    """
    cdef int64_t i, k, s
    cdef double other
    cdef bint changed = False
    cdef uint8_t[::1] done = np.zeros(cost.shape[0], dtype=np.uint8)
    with nogil:
        for i in range(order.shape[0]):
            s = order[i]
            done[s] = True
            for k in range(indptr[s], indptr[s + 1]):
                if cost[s] < cost[indices[k]] and data[k] > 0.0:
                    other = cost[s] + cost_of_jump(data[k], leaving[s])
                    if other < cost[indices[k]]:
                        cost[indices[k]] = other
                        changed = changed or done[indices[k]]
    return changed


def raise_costs(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                const double[::1] leaving, double[::1] cost, double exponent, double margin,
                double least) -> int:
    """Raise the costs of states above `least`, in place, until (Q w)(s) <= -margin leaving(s) w(s)
    for the present costs of the others, where w(s) = exp(exponent cost(s)); how many were raised.
    """
    cdef int64_t n = cost.shape[0], s, k, raised = 0
    cdef double total
    with nogil:
        for s in range(n):
            if cost[s] <= least:
                continue
            total = 0.0
            for k in range(indptr[s], indptr[s + 1]):
                total = total + data[k] * (exp(exponent * (cost[indices[k]] - cost[s])) - 1.0)
            total = total / leaving[s] + margin
            if total > 0.0:
                cost[s] += log1p(total) / exponent
                raised += 1
    return raised


def drift(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
          const double[::1] logarithm, double margin, double[::1] out):
    """Upper bounds on (Q w)(s) / w(s) for the logarithm of w, float64[n].

    margin: the relative rounding error of a row, exponentials included.
    """
    cdef int64_t n = logarithm.shape[0], s, k
    cdef double total, size, growth
    with nogil:
        for s in range(n):
            total = size = 0.0
            for k in range(indptr[s], indptr[s + 1]):
                growth = exp(logarithm[indices[k]] - logarithm[s])
                total = total + data[k] * (growth - 1.0)
                size = size + data[k] * (growth + 1.0)
            out[s] = total + margin * size
