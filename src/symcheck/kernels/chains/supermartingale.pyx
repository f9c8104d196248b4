# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Costs of paths in a chain, and the exponential supermartingales that they suggest.

A chain is given by its rates in compressed rows (int64[n+1], int32, float64), its total rates of
leaving float64[n], which include `killing`, and the rates of a reward, float64[n], at most 1.
"""

import numpy as np

from libc.math cimport INFINITY, exp, isfinite, log, log1p
from libc.stdint cimport int32_t, int64_t, uint8_t


cdef inline double cost_of_jump(double rate, double leaving) noexcept nogil:
    """Minus the logarithm of twice the probability: a jump that is likelier than not costs nothing.
    """
    return 0.0 if 2.0 * rate >= leaving else log(0.5 * leaving / rate)


def relax(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
          const double[::1] leaving, const double[::1] reward, const int32_t[::1] order,
          double[::1] cost) -> bool:
    """Lower the costs of some states in turn, in place; whether any became less.

    order: int32[k], the states. cost: float64[n], of the cheapest known path that earns the reward.
    """
    cdef int64_t i, k, s
    cdef double least, other
    cdef bint changed = False
    with nogil:
        for i in range(order.shape[0]):
            s = order[i]
            least = cost[s]
            if reward[s] > 0.0 and least > 0.0:
                other = cost_of_jump(reward[s], leaving[s])
                if other < least:
                    least = other
            for k in range(indptr[s], indptr[s + 1]):
                # Successors that cost more need no logarithm.
                if cost[indices[k]] < least and data[k] > 0.0:
                    other = cost[indices[k]] + cost_of_jump(data[k], leaving[s])
                    if other < least:
                        least = other
            if least < cost[s]:
                cost[s] = least
                changed = True
    return changed


def missing_constant(const int64_t[::1] indptr, const int32_t[::1] indices,
                     const double[::1] data, const double[::1] leaving, const double[::1] reward,
                     double killing, const double[::1] cost, double exponent) -> float:
    """The least C for which u(s) = exp(-exponent cost(s)) + C is at least
    (rates u + reward)(s) / leaving(s) in every state s; infinity if none is found.
    """
    cdef int64_t n = cost.shape[0], s, k
    cdef double total, slack, here, missing = 0.0
    with nogil:
        for s in range(n):
            if cost[s] == INFINITY:
                continue
            total = 0.0
            if reward[s] > 0.0:
                total = reward[s] * exp(exponent * cost[s])
            for k in range(indptr[s], indptr[s + 1]):
                total = total + data[k] * exp(exponent * (cost[s] - cost[indices[k]]))
            # Far more than the rounding of a row with thousands of entries.
            total = total * (1.0 + 1e-12) / leaving[s] - 1.0
            if total <= 0.0:
                continue
            slack = killing / leaving[s] - 1e-12
            if not (slack > 0.0 and isfinite(total)):
                missing = INFINITY
                break
            here = exp(log(total / slack) - exponent * cost[s])
            if here > missing:
                missing = here
    return missing


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
    for the present costs of the others; how many were raised. See `drift` for w.
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
          const double[::1] cost, double exponent, double[::1] out):
    """Upper bounds on (Q w)(s) / w(s) for w(s) = exp(exponent cost(s)), float64[n]."""
    cdef int64_t n = cost.shape[0], s, k
    cdef double total, size, growth
    with nogil:
        for s in range(n):
            total = size = 0.0
            for k in range(indptr[s], indptr[s + 1]):
                growth = exp(exponent * (cost[indices[k]] - cost[s]))
                total = total + data[k] * (growth - 1.0)
                size = size + data[k] * (growth + 1.0)
            # Far more than the rounding of a row with thousands of entries.
            out[s] = total + 1e-12 * size
