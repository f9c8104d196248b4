# cython: language_level=3
"""Hashes of 64-bit words, and doubles cut short so that sums in another order hash alike."""
from libc.math cimport floor, frexp, ldexp
from libc.stdint cimport uint64_t
from libc.string cimport memcpy

cdef inline uint64_t mix(uint64_t x) noexcept nogil:
    """The finalizer of splitmix64: every bit of the word counts for every bit of the hash."""
    x ^= x >> 30
    x *= <uint64_t>0xBF58476D1CE4E5B9
    x ^= x >> 27
    x *= <uint64_t>0x94D049BB133111EB
    x ^= x >> 31
    return x

cdef inline uint64_t mix_with(uint64_t x, uint64_t small) noexcept nogil:
    """The hash of a word and a small number beside it."""
    return mix(x ^ (small * <uint64_t>0x9E3779B97F4A7C15))

cdef inline double shortened(double value) noexcept nogil:
    """A double rounded to 44 binary digits: sums in another order are the same."""
    cdef int exponent
    cdef double part = frexp(value, &exponent)
    return ldexp(floor(part * 17592186044416.0 + 0.5), exponent - 44)

cdef inline uint64_t bits_of(double value) noexcept nogil:
    cdef uint64_t bits
    memcpy(&bits, &value, 8)
    return bits
