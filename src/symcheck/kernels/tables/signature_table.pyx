# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Bags: sparse vectors, each kept once. A bag is known by its number; 0 is the empty one, -1 says that memory ended.

The key of an entry is an int32; entries are sorted by key. The value of a key that is not negative is a number of 128 bits, in
units of 2 ** -exponent, so that sums are exact and do not depend on their order; of a negative key it is a double, as bits, that is
never added to. A set is a bag whose values are all 0.
"""

from libc.math cimport frexp, ldexp
from libc.stdlib cimport free, malloc
from libc.string cimport memcmp, memcpy, memset

import cython

from symcheck.kernels.tables.hash_mix cimport bits_of, mix, shortened
from symcheck.kernels.memory cimport Buffer, release, reserve

__all__ = ["Bags"]


cdef inline int128 shortened_sum(int128 value) noexcept nogil:
    """The same for an exact sum, which is not negative."""
    cdef int length = 0, shift
    cdef int128 rest = value
    while (rest >> 32) != 0:
        rest >>= 32
        length += 32
    while rest != 0:
        rest >>= 1
        length += 1
    if length <= 44:
        return value
    shift = length - 44
    return ((value + (<int128>1 << (shift - 1))) >> shift) << shift


cdef inline int128 as_bits(double value) noexcept nogil:
    return <int128>bits_of(value)


cdef inline double from_bits(int128 value) noexcept nogil:
    cdef uint64_t bits = <uint64_t>value
    cdef double out
    memcpy(&out, &bits, 8)
    return out


@cython.final
cdef class Bags:
    """A table of bags that only grows. exponent: the lowest binary digit that a value may have, negated."""

    def __cinit__(self, int exponent):
        self.exponent = exponent
        self.mask = 1023
        self.table = <int32_t*>malloc(1024 * sizeof(int32_t))
        if self.table == NULL or reserve(&self.starts, 8 * 1024):
            raise MemoryError
        memset(self.table, 0xFF, 1024 * sizeof(int32_t))
        (<int64_t*>self.starts.data)[0] = 0
        if self.room(0) < 0 or self.finish(0) != 0:
            raise MemoryError

    def __dealloc__(self):
        free(self.table)
        release(&self.keys)
        release(&self.values)
        release(&self.starts)
        release(&self.hashes)
        release(&self.rounding)
        release(&self.raw)

    def __len__(self):
        return self.count

    cdef int64_t memory(self) noexcept nogil:
        return (self.keys.size + self.values.size + self.starts.size + self.hashes.size + self.rounding.size + self.raw.size
                + 4 * (self.mask + 1))

    cdef int64_t length(self, int a) noexcept nogil:
        return (<int64_t*>self.starts.data)[a + 1] - (<int64_t*>self.starts.data)[a]

    cdef int32_t* keys_of(self, int a) noexcept nogil:
        return <int32_t*>self.keys.data + (<int64_t*>self.starts.data)[a]

    cdef int128* values_of(self, int a) noexcept nogil:
        return <int128*>self.values.data + (<int64_t*>self.starts.data)[a]

    cdef double value(self, int a, int64_t which) noexcept nogil:
        """A value, rounded to the nearest double."""
        cdef int128 value = self.values_of(a)[which]
        return from_bits(value) if self.keys_of(a)[which] < 0 else ldexp(<double>value, -self.exponent)

    cdef int raw_of(self, int a) noexcept nogil:
        """The first bag that was rounded to this one."""
        return (<int32_t*>self.raw.data)[a]

    cdef int64_t room(self, int64_t entries) noexcept nogil:
        """Room for so many entries behind the last bag; -1 when memory ends. Pointers into bags are stale afterwards."""
        if reserve(&self.keys, 4 * (self.size + entries) + 4) or reserve(&self.values, 16 * (self.size + entries) + 16):
            return -1
        return self.size

    cdef int finish(self, int64_t length) noexcept nogil:
        """The number of the bag that was written behind the last one; kept if it is new."""
        cdef int32_t* keys = <int32_t*>self.keys.data + self.size
        cdef int128* values = <int128*>self.values.data + self.size
        cdef uint64_t h = <uint64_t>length
        cdef int64_t i, place
        cdef int found
        for i in range(length):
            h = mix(h ^ mix(<uint64_t>values[i] + <uint64_t>0x9E3779B97F4A7C15 * <uint64_t>(keys[i] + <int64_t>1)))
            h += mix(<uint64_t>(values[i] >> 64))
        place = <int64_t>h & self.mask
        while self.table[place] >= 0:
            found = self.table[place]
            if ((<uint64_t*>self.hashes.data)[found] == h and self.length(found) == length
                    and memcmp(self.keys_of(found), keys, 4 * length) == 0
                    and memcmp(self.values_of(found), values, 16 * length) == 0):
                return found
            place = (place + 1) & self.mask
        found = <int>self.count
        if (self.count >= 0x7FFFFFF0 or reserve(&self.starts, 8 * (self.count + 2)) or reserve(&self.hashes, 8 * (self.count + 1))
                or reserve(&self.rounding, 4 * (self.count + 1)) or reserve(&self.raw, 4 * (self.count + 1))):
            return -1
        self.table[place] = found
        self.size += length
        (<int64_t*>self.starts.data)[found + 1] = self.size
        (<uint64_t*>self.hashes.data)[found] = h
        (<int32_t*>self.rounding.data)[found] = -1
        (<int32_t*>self.raw.data)[found] = -1
        self.count += 1
        if 2 * self.count > self.mask and self.rehash() < 0:
            return -1
        return found

    cdef int rehash(self) noexcept nogil:
        cdef int64_t mask = 2 * self.mask + 1, i, place
        cdef int32_t* table = <int32_t*>malloc((mask + 1) * sizeof(int32_t))
        if table == NULL:
            return -1
        memset(table, 0xFF, (mask + 1) * sizeof(int32_t))
        for i in range(self.count):
            place = <int64_t>(<uint64_t*>self.hashes.data)[i] & mask
            while table[place] >= 0:
                place = (place + 1) & mask
            table[place] = <int32_t>i
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    cdef int one(self, int key, double value) noexcept nogil:
        """The bag of one entry: a weight, or with a negative key any number."""
        cdef int exponent
        cdef double part
        if self.room(1) < 0:
            return -1
        (<int32_t*>self.keys.data)[self.size] = key
        if key < 0:
            (<int128*>self.values.data)[self.size] = as_bits(value)
        else:
            part = frexp(value, &exponent)
            exponent += self.exponent - 53
            value = ldexp(part, 53)
            # Digits that would be shifted out are 0, by the choice of the exponent.
            (<int128*>self.values.data)[self.size] = <int128>value << exponent if exponent >= 0 else <int128>value >> -exponent
        return self.finish(1)

    cdef int add(self, int a, int b) noexcept nogil:
        """The sum of two bags."""
        cdef int64_t la = self.length(a), lb = self.length(b), i = 0, j = 0, n = 0
        if self.room(la + lb) < 0:
            return -1
        cdef int32_t* ka = self.keys_of(a)
        cdef int32_t* kb = self.keys_of(b)
        cdef int32_t* keys = <int32_t*>self.keys.data + self.size
        cdef int128* va = self.values_of(a)
        cdef int128* vb = self.values_of(b)
        cdef int128* values = <int128*>self.values.data + self.size
        while i < la or j < lb:
            if j == lb or (i < la and ka[i] < kb[j]):
                keys[n] = ka[i]
                values[n] = va[i]
                i += 1
            elif i == la or kb[j] < ka[i]:
                keys[n] = kb[j]
                values[n] = vb[j]
                j += 1
            else:
                keys[n] = ka[i]
                values[n] = va[i] + vb[j]
                i += 1
                j += 1
            n += 1
        return self.finish(n)

    cdef int scaled(self, int a, int doublings) noexcept nogil:
        """The bag times two to the number of doublings."""
        cdef int64_t n = self.length(a), i
        if self.room(n) < 0:
            return -1
        cdef int128* source = self.values_of(a)
        cdef int128* values = <int128*>self.values.data + self.size
        memcpy(<int32_t*>self.keys.data + self.size, self.keys_of(a), 4 * n)
        for i in range(n):
            values[i] = source[i] << doublings
        return self.finish(n)

    cdef int rounded(self, int a) noexcept nogil:
        """The bag with its values rounded to 44 binary digits."""
        cdef int found = (<int32_t*>self.rounding.data)[a]
        cdef int64_t length = self.length(a), i
        cdef int128 value
        if found >= 0:
            return found
        if self.room(length) < 0:
            return -1
        for i in range(length):
            value = self.values_of(a)[i]
            value = as_bits(shortened(from_bits(value))) if self.keys_of(a)[i] < 0 else shortened_sum(value)
            (<int32_t*>self.keys.data)[self.size + i] = self.keys_of(a)[i]
            (<int128*>self.values.data)[self.size + i] = value
        found = self.finish(length)
        if found >= 0:
            (<int32_t*>self.rounding.data)[a] = found
            (<int32_t*>self.rounding.data)[found] = found
            if (<int32_t*>self.raw.data)[found] < 0:
                (<int32_t*>self.raw.data)[found] = a
        return found

    cdef int with_key(self, int a, int key) noexcept nogil:
        """The set with one more member."""
        cdef int64_t n = self.length(a), i = 0, place
        if self.room(n + 1) < 0:
            return -1
        cdef int32_t* source = self.keys_of(a)
        cdef int32_t* keys = <int32_t*>self.keys.data + self.size
        while i < n and source[i] < key:
            i += 1
        if i < n and source[i] == key:
            return a
        place = i
        memcpy(keys, source, 4 * place)
        keys[place] = key
        memcpy(keys + place + 1, source + place, 4 * (n - place))
        memset(<int128*>self.values.data + self.size, 0, 16 * (n + 1))
        return self.finish(n + 1)

    cdef int copied(self, Bags other, int a) noexcept nogil:
        """A bag of another table, in this one."""
        cdef int64_t n = other.length(a)
        if self.room(n) < 0:
            return -1
        memcpy(<int32_t*>self.keys.data + self.size, other.keys_of(a), 4 * n)
        memcpy(<int128*>self.values.data + self.size, other.values_of(a), 16 * n)
        return self.finish(n)
