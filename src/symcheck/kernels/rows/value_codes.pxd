# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Products with rows whose values are codes into a table, or float64 (the table is then unused)."""

from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t

ctypedef fused Value:
    uint8_t
    uint16_t
    double


cdef inline double add_row_product(double total, const int32_t* indices, const Value* values,
                                   const double* table, const double* x, int64_t begin,
                                   int64_t end) noexcept nogil:
    """total plus the products of the entries `begin` to `end` - 1 and x, in their order."""
    cdef int64_t k
    for k in range(begin, end):
        if Value is double:
            total = total + values[k] * x[indices[k]]
        else:
            total = total + table[values[k]] * x[indices[k]]
    return total
