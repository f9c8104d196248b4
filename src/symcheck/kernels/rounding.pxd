# cython: language_level=3
"""Outward rounding of sums of non-negative products.

A sum of k products of non-negative doubles has a relative error below (k + 1) unit roundoffs, in any
order of addition (Higham 2002, section 3.1). Bounds are widened by k + 8 unit roundoffs, which also
covers a division by 1 - (self-loop), and upper bounds by UNDERFLOW_MARGIN for products that underflow.
"""
from libc.stdint cimport int64_t

cdef extern from *:
    """
    #define UNIT_ROUNDOFF 1.1102230246251568e-16 /* a little above 2^-53 */
    #define EXTRA_ROUNDINGS 8.0
    #define UNDERFLOW_MARGIN 1e-307
    """
    const double UNIT_ROUNDOFF
    const double EXTRA_ROUNDINGS
    const double UNDERFLOW_MARGIN


cdef inline double error_of_sum(int64_t terms) noexcept nogil:
    """Relative rounding error of a sum of products."""
    return (terms + EXTRA_ROUNDINGS) * UNIT_ROUNDOFF


cdef inline double round_down(double sum, double error) noexcept nogil:
    """A lower bound of a sum with this relative error."""
    return sum - sum * error


cdef inline double round_up(double sum, double error) noexcept nogil:
    """An upper bound of a sum with this relative error."""
    return sum + (sum * error + (UNDERFLOW_MARGIN if sum > 0.0 else 0.0))
