# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products with rows."""

from libc.stdint cimport int32_t, int64_t


cdef inline double add_row_product(double total, const int32_t* indices, const double* values,
                                   const double* x, int64_t begin, int64_t end) noexcept nogil:
    """total plus the products of the entries `begin` to `end` - 1 and x, in their order."""
    cdef int64_t k
    for k in range(begin, end):
        total = total + values[k] * x[indices[k]]
    return total
