# cython: language_level=3
"""Diagrams and ODDs as plain C structures, shared by the kernels that traverse them."""
from libc.stdint cimport int32_t, int64_t

cdef enum:
    OUT_OF_MEMORY = -1
    OVERFLOW = -2
    FOREIGN_LEVEL = -3

cdef enum:
    MAX_NODES = 0x7FFFFFF0

cdef struct Diagram:
    const int32_t* level
    const int32_t* low
    const int32_t* high
    const double* value   # of the leaves, which are the nodes below `leaves`
    int32_t leaves
    int32_t root

cdef struct Odd:
    const int32_t* depth
    const int32_t* low
    const int32_t* high
    const int64_t* count
    int32_t root

cdef Diagram diagram_of(tuple diagram)
cdef Odd odd_of(tuple odd)
cdef const int32_t* pointer_of(const int32_t[::1] array) noexcept
cdef object walk_error(int64_t status)
