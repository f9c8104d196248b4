# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Value iteration of turn-based games in place, which keeps the rows by which values changed last."""

from libc.math cimport fabs
from libc.stdint cimport int64_t, int32_t, uint8_t


def sweep_game(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
               const int64_t[::1] groups, const double[::1] constant,
               const uint8_t[::1] maximises, const uint8_t[::1] leads, bint raises,
               double smallest, double[::1] x, int64_t[::1] policy, bint descending) -> float:
    """One sweep of x = opt(A x + b); values only rise, or only fall.

    Args:
        indptr, indices, data: int64[rows+1], int32, float64: A. groups: int64[n+1], the rows of each
            state. constant: b, float64[rows].
        maximises: uint8[n], the states whose greatest value is taken; the least one elsewhere.
        leads: uint8[n], the states whose row is kept.
        raises: whether values rise; they fall otherwise.
        smallest: the least relative change that counts.
        x: float64[n], the values, which are changed.
        policy: int64[n]; a row is stored for a leading state whose value changes.
        descending: start at the last state.

    Returns:
        The largest relative change.
    """
    cdef int64_t n = groups.shape[0] - 1, i, s, r, k, row
    cdef double best, value, change, largest = 0.0
    with nogil:
        for i in range(n):
            s = n - 1 - i if descending else i
            row = -1
            best = 0.0
            for r in range(groups[s], groups[s + 1]):
                value = constant[r]
                for k in range(indptr[r], indptr[r + 1]):
                    value = value + data[k] * x[indices[k]]
                if row < 0 or (value > best if maximises[s] else value < best):
                    best = value
                    row = r
            change = best - x[s] if raises else x[s] - best
            if change > smallest * fabs(x[s]):
                x[s] = best
                if leads[s]:
                    policy[s] = row
                if change > largest * fabs(best):
                    largest = change / fabs(best) if best != 0.0 else 1.0
    return largest
