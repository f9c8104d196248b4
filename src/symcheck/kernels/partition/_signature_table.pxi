# The unique table of signatures: sparse vectors, each stored once and known by its number.
#
# The signature of a state maps the blocks of a partition to sums of probabilities (Derisavi, Hermanns
# & Sanders 2003; Wimmer, Derisavi & Hermanns 2010). Number 0 is the empty vector; -1 says that memory
# ended.
#
# Keys are int32, and entries are sorted by key. The value of a non-negative key is a 128-bit integer
# in units of 2 ** -exponent, so sums are exact and independent of their order. The value of a
# negative key (a reward structure) is the bit pattern of a double, which is never added to. A set is
# a vector whose values are all 0.

cdef struct Vector:
    int64_t start, length          # of its entries
    uint64_t hash
    int32_t rounded, unrounded     # vectors that `round_values` maps this one to, and from; or -1


cdef inline Wide round_sum_to_44_bits(Wide value) noexcept nogil:
    """A non-negative exact sum rounded to 44 binary digits."""
    cdef int length = 64 if wide_high(value) else 0, shift
    cdef uint64_t remaining = wide_high(value) if length else wide_low(value)
    while remaining != 0:
        remaining >>= 1
        length += 1
    if length <= 44:
        return value
    shift = length - 44
    return wide_left(wide_right(wide_sum(value, wide_left(wide_of(1), shift - 1)), shift), shift)


cdef inline Wide as_bits(double value) noexcept nogil:
    """The bit pattern of a double as a value."""
    return wide_of(double_bits(value))


cdef inline double from_bits(Wide value) noexcept nogil:
    """The double of a bit pattern."""
    cdef uint64_t bits = wide_low(value)
    cdef double out
    memcpy(&out, &bits, 8)
    return out


@cython.final
cdef class SignatureTable:
    """A table of sparse vectors that only grows.

    exponent: minus the exponent of the lowest binary digit that a value may have.
    """

    cdef Buffer keys, values, vectors
    cdef int32_t* table
    cdef int64_t mask
    cdef int64_t count, entries
    cdef int exponent

    def __cinit__(self, int exponent):
        self.exponent = exponent
        self.mask = 1023
        self.table = <int32_t*>malloc(1024 * sizeof(int32_t))
        if self.table == NULL:
            raise MemoryError
        memset(self.table, 0xFF, 1024 * sizeof(int32_t))
        if self.reserve_entries(0) < 0 or self.intern(0) != 0:
            raise MemoryError

    def __dealloc__(self):
        free(self.table)
        release(&self.keys)
        release(&self.values)
        release(&self.vectors)

    cdef int64_t nbytes(self) noexcept nogil:
        """Memory held, in bytes."""
        return self.keys.size + self.values.size + self.vectors.size + 4 * (self.mask + 1)

    cdef inline Vector* vector(self, int64_t a) noexcept nogil:
        """What is known about a vector."""
        return <Vector*>self.vectors.data + a

    cdef int64_t length(self, int a) noexcept nogil:
        """Number of entries of a vector."""
        return self.vector(a).length

    cdef int32_t* keys_of(self, int a) noexcept nogil:
        """The keys of a vector."""
        return <int32_t*>self.keys.data + self.vector(a).start

    cdef Wide* values_of(self, int a) noexcept nogil:
        """The values of a vector."""
        return <Wide*>self.values.data + self.vector(a).start

    cdef double value(self, int a, int64_t index) noexcept nogil:
        """The value at an index, rounded to the nearest double."""
        cdef Wide value = self.values_of(a)[index]
        return (from_bits(value) if self.keys_of(a)[index] < 0 else ldexp(wide_double(value),
                                                                          -self.exponent))

    cdef int unrounded(self, int a) noexcept nogil:
        """The first vector that `round_values` mapped to this one."""
        return self.vector(a).unrounded

    cdef int64_t reserve_entries(self, int64_t more) noexcept nogil:
        """Make room for so many entries behind the last vector; -1 when memory ends.

        Pointers into vectors from before the call become invalid.
        """
        if (reserve(&self.keys, 4 * (self.entries + more) + 4)
                or reserve(&self.values, 16 * (self.entries + more) + 16)):
            return -1
        return self.entries

    cdef int intern(self, int64_t length) noexcept nogil:
        """The number of the vector that was written behind the last one.

        The entries are kept only if the vector is new. Returns -1 when memory ends.
        """
        cdef int32_t* keys = <int32_t*>self.keys.data + self.entries
        cdef Wide* values = <Wide*>self.values.data + self.entries
        cdef uint64_t h = <uint64_t>length
        cdef int64_t i, slot
        cdef int vector
        for i in range(length):
            h = mix(h ^ mix(wide_low(values[i])
                            + <uint64_t>0x9E3779B97F4A7C15 * <uint64_t>(keys[i] + <int64_t>1)))
            h += mix(wide_high(values[i]))
        slot = <int64_t>h & self.mask
        while self.table[slot] >= 0:
            vector = self.table[slot]
            if (self.vector(vector).hash == h and self.length(vector) == length
                    and memcmp(self.keys_of(vector), keys, 4 * length) == 0
                and memcmp(self.values_of(vector), values, 16 * length) == 0):
                return vector
            slot = (slot + 1) & self.mask
        vector = <int>self.count
        if (self.count >= 0x7FFFFFF0
                or reserve(&self.vectors, (self.count + 1) * sizeof(Vector))):
            return -1
        self.table[slot] = vector
        self.vector(vector)[0] = Vector(self.entries, length, h, -1, -1)
        self.entries += length
        self.count += 1
        if 2 * self.count > self.mask and self.grow() < 0:
            return -1
        return vector

    cdef int grow(self) noexcept nogil:
        """Double the hash table; -1 when memory ends."""
        cdef int64_t mask = 2 * self.mask + 1, i, slot
        cdef int32_t* table = <int32_t*>malloc((mask + 1) * sizeof(int32_t))
        if table == NULL:
            return -1
        memset(table, 0xFF, (mask + 1) * sizeof(int32_t))
        for i in range(self.count):
            slot = <int64_t>self.vector(i).hash & mask
            while table[slot] >= 0:
                slot = (slot + 1) & mask
            table[slot] = <int32_t>i
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    cdef int singleton(self, int key, double value) noexcept nogil:
        """The vector with one entry: a weight, or any double for a negative key."""
        cdef int exponent
        cdef double mantissa
        if self.reserve_entries(1) < 0:
            return -1
        (<int32_t*>self.keys.data)[self.entries] = key
        if key < 0:
            (<Wide*>self.values.data)[self.entries] = as_bits(value)
        else:
            mantissa = frexp(value, &exponent)
            exponent += self.exponent - 53
            value = ldexp(mantissa, 53)
            # Digits that would be shifted out are 0, by the choice of the exponent.
            if exponent >= 0:
                (<Wide*>self.values.data)[self.entries] = wide_left(wide_of(<uint64_t>value),
                                                                         exponent)
            else:
                (<Wide*>self.values.data)[self.entries] = wide_right(wide_of(<uint64_t>value),
                                                                          -exponent)
        return self.intern(1)

    cdef int add(self, int a, int b) noexcept nogil:
        """The sum of two vectors."""
        cdef int64_t length_a = self.length(a), length_b = self.length(b), i = 0, j = 0, n = 0
        if self.reserve_entries(length_a + length_b) < 0:
            return -1
        cdef int32_t* keys_a = self.keys_of(a)
        cdef int32_t* keys_b = self.keys_of(b)
        cdef int32_t* keys = <int32_t*>self.keys.data + self.entries
        cdef Wide* values_a = self.values_of(a)
        cdef Wide* values_b = self.values_of(b)
        cdef Wide* values = <Wide*>self.values.data + self.entries
        while i < length_a or j < length_b:
            if j == length_b or (i < length_a and keys_a[i] < keys_b[j]):
                keys[n] = keys_a[i]
                values[n] = values_a[i]
                i += 1
            elif i == length_a or keys_b[j] < keys_a[i]:
                keys[n] = keys_b[j]
                values[n] = values_b[j]
                j += 1
            else:
                keys[n] = keys_a[i]
                values[n] = wide_sum(values_a[i], values_b[j])
                i += 1
                j += 1
            n += 1
        return self.intern(n)

    cdef int shift_left(self, int a, int shift) noexcept nogil:
        """The vector times 2 ** shift."""
        cdef int64_t n = self.length(a), i
        if self.reserve_entries(n) < 0:
            return -1
        cdef Wide* source = self.values_of(a)
        cdef Wide* values = <Wide*>self.values.data + self.entries
        memcpy(<int32_t*>self.keys.data + self.entries, self.keys_of(a), 4 * n)
        for i in range(n):
            values[i] = wide_left(source[i], shift)
        return self.intern(n)

    cdef int round_values(self, int a) noexcept nogil:
        """The vector with its values rounded to 44 binary digits."""
        cdef int vector = self.vector(a).rounded
        cdef int64_t length = self.length(a), i
        cdef Wide value
        if vector >= 0:
            return vector
        if self.reserve_entries(length) < 0:
            return -1
        for i in range(length):
            value = self.values_of(a)[i]
            value = (as_bits(round_to_44_bits(from_bits(value)))
                     if self.keys_of(a)[i] < 0 else round_sum_to_44_bits(value))
            (<int32_t*>self.keys.data)[self.entries + i] = self.keys_of(a)[i]
            (<Wide*>self.values.data)[self.entries + i] = value
        vector = self.intern(length)
        if vector >= 0:
            self.vector(a).rounded = self.vector(vector).rounded = vector
            if self.vector(vector).unrounded < 0:
                self.vector(vector).unrounded = a
        return vector

    cdef int insert_key(self, int a, int key) noexcept nogil:
        """The set with one more member."""
        cdef int64_t n = self.length(a), i = 0, slot
        if self.reserve_entries(n + 1) < 0:
            return -1
        cdef int32_t* source = self.keys_of(a)
        cdef int32_t* keys = <int32_t*>self.keys.data + self.entries
        while i < n and source[i] < key:
            i += 1
        if i < n and source[i] == key:
            return a
        slot = i
        memcpy(keys, source, 4 * slot)
        keys[slot] = key
        memcpy(keys + slot + 1, source + slot, 4 * (n - slot))
        memset(<Wide*>self.values.data + self.entries, 0, 16 * (n + 1))
        return self.intern(n + 1)

    cdef int import_vector(self, SignatureTable other, int a) noexcept nogil:
        """A vector of another table, in this one."""
        cdef int64_t n = other.length(a)
        if self.reserve_entries(n) < 0:
            return -1
        memcpy(<int32_t*>self.keys.data + self.entries, other.keys_of(a), 4 * n)
        memcpy(<Wide*>self.values.data + self.entries, other.values_of(a), 16 * n)
        return self.intern(n)
