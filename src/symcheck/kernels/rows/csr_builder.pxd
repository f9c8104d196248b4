# cython: language_level=3
"""Compressed rows that are written one after the other: see csr_builder.pyx."""

from libc.stdint cimport int32_t, int64_t, uint16_t, uint32_t, uint64_t

from symcheck.kernels.memory cimport Buffer


cdef class CsrBuilder:
    cdef readonly long long opened, closed, groups, entries
    cdef int structures
    cdef Buffer* rewards
    cdef Buffer starts, group_ends, actions, indices
    # weights: codes of the distinct values or, if `raw_weights`, the values themselves
    cdef bint raw_weights
    cdef Buffer weight_codes, weights, distinct_weights, code_table
    cdef uint32_t distinct_count
    cdef Buffer row, merge_table

    cdef int open_row(self) noexcept nogil
    cdef void set_action(self, int action) noexcept nogil
    cdef int close_row(self, const int32_t* ids, const double* weights, long long n) noexcept nogil
    cdef int end_group(self) noexcept nogil
    cdef long long _merge_short(self, const int32_t* ids, const double* weights, long long n,
                                int32_t* indices, double* row) noexcept nogil
    cdef long long _merge_long(self, const int32_t* ids, const double* weights, long long n,
                               int32_t* indices, double* row) noexcept nogil
    cdef int _append(self, const double* row, long long n) noexcept nogil
    cdef int _encode(self, double value, uint16_t* code) noexcept nogil
    cdef int _store_raw_weights(self) noexcept nogil
    cdef void _row_range(self, long long state, bint grouped, long long* begin,
                         long long* end) noexcept nogil
    cdef void _renumber(self, const int32_t* rank) noexcept nogil
    cdef void _release(self) noexcept nogil
