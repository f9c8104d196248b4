# cython: language_level=3
"""Declarations that the conversions between diagrams and arrays share with the making of an ODD."""
from libc.stdint cimport int32_t, int64_t

cdef enum:
    OUT_OF_MEMORY = -1
    OVERFLOW = -2
    FOREIGN_LEVEL = -3
    NOT_A_SUBSET = -4

cdef struct Table:
    const int32_t* level
    const int32_t* low
    const int32_t* high
    const double* value
    int32_t leaves

cdef struct Odd:
    const int32_t* depth
    const int32_t* low
    const int32_t* high
    const int64_t* count

cdef object fault(int64_t status)
cdef object ints(int32_t* data, int64_t n)
cdef Odd odd_of(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high, const int64_t[::1] count)
