# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Costs of the cheapest paths to a reward, and the exponential supermartingales that they suggest.

A chain is given by its rates in compressed rows (int64[n+1], int32, float64), its total rates of
leaving float64[n], which include self-loops and `killing`, and the rates of a reward, float64[n],
at most `killing`.
"""

from libc.math cimport INFINITY, exp, isfinite, log
from libc.stdint cimport int32_t, int64_t

from symcheck.kernels.chains.jump_costs cimport cost_of_jump


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
                     double killing, const double[::1] cost, double exponent, double margin
                     ) -> float:
    """The least C for which u(s) = exp(-exponent cost(s)) + C is at least
    (rates u + reward)(s) / leaving(s) in every state s; infinity if none is found.

    margin: the relative rounding error of a row, exponentials included.
    """
    cdef int64_t n = cost.shape[0], s, k
    cdef double total, slack, here, missing = 0.0
    with nogil:
        for s in range(n):
            total = 0.0
            if cost[s] == INFINITY:  # u(s) = C is enough if nothing else can be reached
                if reward[s] > 0.0:
                    total = INFINITY
                for k in range(indptr[s], indptr[s + 1]):
                    if data[k] > 0.0 and cost[indices[k]] < INFINITY:
                        total = INFINITY
                if total > 0.0:
                    missing = INFINITY
                    break
                continue
            if reward[s] > 0.0:
                total = reward[s] * exp(exponent * cost[s])
            for k in range(indptr[s], indptr[s + 1]):
                total = total + data[k] * exp(exponent * (cost[s] - cost[indices[k]]))
            total = total * (1.0 + margin) / leaving[s] - 1.0
            if total <= 0.0:
                continue
            slack = killing / leaving[s] - margin
            if not (slack > 0.0 and isfinite(total)):
                missing = INFINITY
                break
            here = exp(log(total / slack) - exponent * cost[s])
            if here > missing:
                missing = here
    return missing
