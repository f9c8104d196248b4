# cython: language_level=3
"""Blocks of rows of a triangular matrix, which threads solve for in turn."""
from libc.stdint cimport int32_t, int64_t


cdef class RowBlocks:
    cdef readonly int64_t blocks, levels
    cdef int64_t following
    cdef const int32_t[::1] order, needed
    cdef const int64_t[::1] bounds, needed_ptr, starts
    cdef int32_t[::1] finished
    cdef double[:, ::1] sums
    cdef int32_t round

    cdef int64_t claim(self) noexcept nogil
    cdef void finish(self, int64_t block, double first_sum, double second_sum) noexcept nogil
