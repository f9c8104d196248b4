# cython: language_level=3
"""Outward rounding of sums of non-negative products.

A sum of k products of non-negative doubles has a relative error below (k + 1) unit roundoffs, in any
order of addition (Higham 2002, section 3.1). Bounds are widened by k + 8 unit roundoffs, which also
covers a division by 1 - (self-loop). A product that underflows has an absolute error of at most 2^-1074
instead, which UNDERFLOW_MARGIN exceeds for any number of terms. A sum of 0 may be such an underflow:
callers of round_up then use `underflow_margin`.
"""
from libc.stdint cimport int32_t, int64_t

cdef extern from *:
    """
    #define UNIT_ROUNDOFF 1.1102230246251568e-16 /* a little above 2^-53 */
    #define EXTRA_ROUNDINGS 8.0
    #define UNDERFLOW_MARGIN 1e-307
    #define NEAR_UNDERFLOW 1e-290 /* smaller sums may have lost digits to underflow */
    """
    const double UNIT_ROUNDOFF
    const double EXTRA_ROUNDINGS
    const double UNDERFLOW_MARGIN
    const double NEAR_UNDERFLOW


cdef inline double error_of_sum(int64_t terms) noexcept nogil:
    """Relative rounding error of a sum of products."""
    return (terms + EXTRA_ROUNDINGS) * UNIT_ROUNDOFF


cdef inline double error_of_row(int64_t terms, double error) noexcept nogil:
    """`error_of_sum` for coefficients that have a relative error themselves, twice that if a row is
    divided by its sum; 2 unit roundoffs are among those that are extra."""
    return error_of_sum(terms) + (2.0 * error - 4.0 * UNIT_ROUNDOFF
                                  if error > 2.0 * UNIT_ROUNDOFF else 0.0)


cdef inline double round_down(double sum, double error) noexcept nogil:
    """A lower bound of a sum with this relative error."""
    cdef double bound = sum - sum * error
    if bound > UNDERFLOW_MARGIN:
        return bound - UNDERFLOW_MARGIN
    return bound if bound < 0.0 else 0.0


cdef inline double round_up(double sum, double error) noexcept nogil:
    """An upper bound of a sum with this relative error."""
    return sum + (sum * error + (UNDERFLOW_MARGIN if sum > 0.0 else 0.0))


cdef inline double underflow_margin(const double* data, const int32_t* indices, int64_t begin,
                                    int64_t end, const double* x, int64_t stride) noexcept nogil:
    """An upper bound of A_row x where the computed sum is 0: more than 0 if a product underflows."""
    cdef int64_t k
    for k in range(begin, end):
        if data[k] > 0.0 and x[stride * indices[k]] > 0.0:
            return UNDERFLOW_MARGIN
    return 0.0
