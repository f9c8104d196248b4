# cython: language_level=3
from libc.stdint cimport int32_t, int64_t, uint64_t

from symcheck.kernels.memory cimport Buffer

cdef extern from *:
    ctypedef long long int128 "__int128"


cdef class Bags:
    cdef Buffer keys, values, starts, hashes, rounding, raw
    cdef int32_t* table
    cdef int64_t mask
    cdef int64_t count, size
    cdef int exponent

    cdef int one(self, int key, double value) noexcept nogil
    cdef double value(self, int a, int64_t which) noexcept nogil
    cdef int add(self, int a, int b) noexcept nogil
    cdef int scaled(self, int a, int doublings) noexcept nogil
    cdef int rounded(self, int a) noexcept nogil
    cdef int with_key(self, int a, int key) noexcept nogil
    cdef int copied(self, Bags other, int a) noexcept nogil
    cdef int64_t length(self, int a) noexcept nogil
    cdef int32_t* keys_of(self, int a) noexcept nogil
    cdef int128* values_of(self, int a) noexcept nogil
    cdef int raw_of(self, int a) noexcept nogil
    cdef int64_t memory(self) noexcept nogil
    cdef int64_t room(self, int64_t entries) noexcept nogil
    cdef int finish(self, int64_t length) noexcept nogil
    cdef int rehash(self) noexcept nogil
