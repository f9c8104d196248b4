# cython: language_level=3
"""Compressed rows that are written one after the other and renumbered at the end."""

from libc.stdint cimport int32_t, int64_t, uint16_t, uint32_t, uint64_t

from symcheck.kernels.memory cimport Buffer


cdef class RowStore:
    cdef readonly long long opened, closed, groups, entries
    cdef int structures
    cdef Buffer* rewards
    cdef Buffer starts, ends_of_groups, actions, indices
    # weights: codes of the distinct values, or (wide) the values themselves
    cdef bint wide
    cdef Buffer codes, weights, distinct, places
    cdef uint32_t distinct_count
    cdef Buffer row, table

    cdef int open(self) noexcept nogil
    cdef void label(self, int action) noexcept nogil
    cdef int close(self, const int32_t* ids, const double* weights, long long n) noexcept nogil
    cdef int end_group(self) noexcept nogil
    cdef long long _merge(self, const int32_t* ids, const double* weights, long long n, int32_t* indices, double* row) noexcept nogil
    cdef long long _merge_wide(self, const int32_t* ids, const double* weights, long long n, int32_t* indices,
                               double* row) noexcept nogil
    cdef int _append(self, const double* row, long long n) noexcept nogil
    cdef int _code(self, double value, uint16_t* code) noexcept nogil
    cdef int _widen(self) noexcept nogil
    cdef void _span(self, long long state, bint grouped, long long* begin, long long* end) noexcept nogil
    cdef void _renumber(self, const int32_t* rank) noexcept nogil
    cdef void _drop(self) noexcept nogil
