# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products of matrices whose entries are known as intervals, and whose rows sum to 1."""

from libc.stdint cimport int32_t, int64_t

cdef double UNIT = 2.0 ** -53


cdef inline double dot(const double* a, const double* b, int64_t n) noexcept nogil:
    """The inner product, by four sums."""
    cdef double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0
    cdef int64_t k, end = n - n % 4
    for k in range(0, end, 4):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
    for k in range(end, n):
        s0 += a[k] * b[k]
    return (s0 + s1) + (s2 + s3)


def interval_product(const double[:, ::1] lower, const double[:, ::1] width,
                     const double[::1] least_rest, const double[::1] most_rest,
                     const double[:, ::1] low, const int32_t[:, ::1] ascending,
                     const double[:, ::1] high, const int32_t[:, ::1] descending,
                     double[:, ::1] out_low, double[:, ::1] out_high) -> None:
    """The least and the greatest products of rows within bounds that sum to 1 with columns.

    A row is its lower bounds and a rest of known size, of which each entry gets at most its width.
    The least product gives the rest to the least values, and the greatest to the greatest.

    Args:
        lower, width: float64[r, n], lower bounds, and widths that are not too small.
        least_rest, most_rest: float64[r], bounds on 1 - the sum of the lower bounds.
        low, high: float64[m, n], bounds on the columns (each is a row here), not negative.
        ascending, descending: int32[m, n], the order of the values of `low`, and of `high`.
        out_low, out_high: float64[r, m], receive the products. Each has at most n + 6 roundings,
            none of which is a difference of what is multiplied.
    """
    cdef int64_t i, j, k, c, n = lower.shape[1]
    cdef double total, rest, part
    with nogil:
        for i in range(lower.shape[0]):
            for j in range(low.shape[0]):
                total = dot(&lower[i, 0], &low[j, 0], n)
                rest = least_rest[i]
                for c in range(n):
                    if rest <= 0.0:
                        break
                    k = ascending[j, c]
                    part = width[i, k]
                    if part > 0.0:
                        if part > rest:
                            part = rest
                        total += part * low[j, k]
                        rest = (rest - part) * (1.0 - 4.0 * UNIT)
                out_low[i, j] = total
                total = dot(&lower[i, 0], &high[j, 0], n)
                rest = most_rest[i]
                for c in range(n):
                    if rest <= 0.0:
                        break
                    k = descending[j, c]
                    if high[j, k] <= 0.0:
                        break
                    part = width[i, k]
                    if part > 0.0:
                        if part > rest:
                            part = rest
                        total += part * high[j, k]
                        rest = (rest - part) * (1.0 + 4.0 * UNIT)
                out_high[i, j] = total
