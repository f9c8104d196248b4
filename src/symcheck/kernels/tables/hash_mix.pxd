# cython: language_level=3
"""Hashes of 64-bit words, and doubles rounded so that sums in different orders hash alike."""
from libc.math cimport floor, frexp, ldexp
from libc.stdint cimport uint64_t
from libc.string cimport memcpy

cdef inline uint64_t mix(uint64_t x) noexcept nogil:
    """Hash of a word: the finaliser of splitmix64 (Steele, Lea & Flood 2014)."""
    x ^= x >> 30
    x *= <uint64_t>0xBF58476D1CE4E5B9
    x ^= x >> 27
    x *= <uint64_t>0x94D049BB133111EB
    x ^= x >> 31
    return x

cdef inline uint64_t mix_pair(uint64_t x, uint64_t small) noexcept nogil:
    """Hash of a word and a small number."""
    return mix(x ^ (small * <uint64_t>0x9E3779B97F4A7C15))

cdef inline double round_to_44_bits(double value) noexcept nogil:
    """The double rounded to 44 binary digits.

    Sums of the same numbers in different orders differ in their last digits only, so they become
    equal.
    """
    cdef int exponent
    cdef double mantissa = frexp(value, &exponent)
    return ldexp(floor(mantissa * 17592186044416.0 + 0.5), exponent - 44)

cdef inline uint64_t double_bits(double value) noexcept nogil:
    """The bit pattern of a double."""
    cdef uint64_t bits
    memcpy(&bits, &value, 8)
    return bits
