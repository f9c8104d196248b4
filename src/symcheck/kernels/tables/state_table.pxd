# cython: language_level=3
"""Sets of packed states: see state_table.pyx."""

cimport cython
from libc.stdint cimport int32_t, uint64_t

from symcheck.kernels.memory cimport Buffer


@cython.final
cdef class StateSet:
    cdef readonly int words
    cdef readonly long long count
    cdef Buffer rows
    cdef uint64_t* table
    cdef uint64_t mask

    cdef int insert(self, const uint64_t* rows, Py_ssize_t n, int32_t* ids) noexcept nogil
    cdef int _grow_table(self, uint64_t size) noexcept nogil
