# cython: language_level=3
"""The table of signatures: see signature_table.pyx."""
from libc.stdint cimport int32_t, int64_t, uint64_t

from symcheck.kernels.memory cimport Buffer

cdef extern from *:
    ctypedef long long int128 "__int128"


cdef class SignatureTable:
    cdef Buffer keys, values, starts, hashes, rounded_ids, unrounded_ids
    cdef int32_t* table
    cdef int64_t mask
    cdef int64_t count, entries
    cdef int exponent

    cdef int singleton(self, int key, double value) noexcept nogil
    cdef double value(self, int a, int64_t index) noexcept nogil
    cdef int add(self, int a, int b) noexcept nogil
    cdef int shift_left(self, int a, int shift) noexcept nogil
    cdef int round_values(self, int a) noexcept nogil
    cdef int insert_key(self, int a, int key) noexcept nogil
    cdef int import_vector(self, SignatureTable other, int a) noexcept nogil
    cdef int64_t length(self, int a) noexcept nogil
    cdef int32_t* keys_of(self, int a) noexcept nogil
    cdef int128* values_of(self, int a) noexcept nogil
    cdef int unrounded(self, int a) noexcept nogil
    cdef int64_t nbytes(self) noexcept nogil
    cdef int64_t reserve_entries(self, int64_t more) noexcept nogil
    cdef int intern(self, int64_t length) noexcept nogil
    cdef int grow(self) noexcept nogil
