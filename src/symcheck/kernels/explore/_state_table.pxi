# Sets of packed states (rows of uint64 words), numbered in the order of insertion.
#
# The hash table uses open addressing. An entry holds 32 bits of the hash and the state's number + 1,
# so a probe rarely reads a row without need. Rows are inserted in chunks: the table slots of a chunk,
# and then the rows, are prefetched, which decides the speed of sets that are larger than the caches.



cdef enum:
    MAX_STATES = 2147483647


cdef inline uint64_t hash_row(const uint64_t* row, int words) noexcept nogil:
    """Hash of a row."""
    cdef uint64_t h = 0x9E3779B97F4A7C15ULL
    cdef int w
    for w in range(words):
        h = (h ^ row[w]) * 0xFF51AFD7ED558CCDULL
        h ^= h >> 32
    h *= 0xC4CEB9FE1A85EC53ULL
    return h ^ (h >> 29)


cdef inline bint rows_equal(const uint64_t* a, const uint64_t* b, int words) noexcept nogil:
    """Whether two rows are equal."""
    cdef int w
    for w in range(words):
        if a[w] != b[w]:
            return False
    return True


@cython.final
cdef class StateSet:
    """A set of packed states, empty at first.

    Args:
        words: number of uint64 words of a state.
    """

    cdef readonly int words
    cdef readonly long long count
    cdef Buffer rows, table_memory
    cdef uint64_t* table
    cdef uint64_t mask

    def __cinit__(self, int words):
        self.words = words
        self.count = 0
        self.rows.data = NULL
        self.rows.size = 0
        self.mask = 0
        if self._grow_table(1024):
            raise MemoryError

    def __dealloc__(self):
        release(&self.rows)
        release(&self.table_memory)

    def __len__(self):
        return self.count

    @property
    def nbytes(self) -> int:
        """Memory held, in bytes."""
        return self.rows.size + (8 * (self.mask + 1) if self.table != NULL else 0)

    def add(self, const uint64_t[:, ::1] rows, int32_t[::1] ids):
        """Insert states that may be known already.

        Args:
            rows: uint64[n, words].
            ids: int32[n], receives the number of each state.
        Raises:
            MemoryError: memory ended; OverflowError: there are more than 2**31 - 1 states.
        """
        cdef int status
        if rows.shape[0] == 0:
            return
        if self.table == NULL:
            raise ValueError("the table is dropped")
        with nogil:
            status = self.insert(&rows[0, 0], rows.shape[0], &ids[0])
        if status == 1:
            raise MemoryError
        if status:
            raise OverflowError("more than 2**31 - 1 states")

    def contains(self, const uint64_t[:, ::1] rows) -> Bools:
        """Whether each of some packed states (uint64[n, words]) is in the set: bool[n]."""
        cdef Py_ssize_t i
        cdef uint8_t[::1] found = np.zeros(rows.shape[0], np.uint8)
        with nogil:
            for i in range(rows.shape[0]):
                found[i] = self.has(&rows[i, 0])
        return np.asarray(found).view(np.bool_)

    cdef bint has(self, const uint64_t* row) noexcept nogil:
        """Whether a state is in the set."""
        cdef const uint64_t* stored = <const uint64_t*> self.rows.data
        cdef uint64_t h = hash_row(row, self.words), slot = h & self.mask, entry
        while True:
            entry = self.table[slot]
            if entry == 0:
                return False
            if (entry >> 32 == h >> 32
                    and rows_equal(stored + ((entry & 0xFFFFFFFFULL) - 1) * self.words, row,
                                   self.words)):
                return True
            slot = (slot + 1) & self.mask

    def drop_table(self):
        """Free the hash table; no state can be inserted afterwards."""
        release(&self.table_memory)
        self.table = NULL

    def view_rows(self) -> Words:
        """All states as they are stored, without a copy: uint64[count, words].

        The view is valid until the next `add` or `drop_rows`.
        """
        if self.count == 0:
            return np.empty((0, self.words), np.uint64)
        return np.asarray(<uint64_t[:self.count, :self.words]> <uint64_t*> self.rows.data)

    def drop_rows(self):
        """Free the states and the hash table; only the number of states remains known."""
        self.drop_table()
        release(&self.rows)

    cdef int _grow_table(self, uint64_t size) noexcept nogil:
        """Rebuild the hash table with `size` entries; 1 when memory ends."""
        cdef Buffer memory = Buffer(NULL, 0, 0)
        cdef uint64_t* table
        cdef const uint64_t* rows = <const uint64_t*> self.rows.data
        cdef uint64_t mask = size - 1, h, slot, next_hash
        cdef long long i
        cdef uint64_t hashes[16]
        if reserve(&memory, size * 8):
            return 1
        table = <uint64_t*> memory.data
        memset(table, 0, size * 8)
        for i in range(self.count + 16):
            if i >= 16:
                h = hashes[i & 15]
                slot = h & mask
                while table[slot]:
                    slot = (slot + 1) & mask
                table[slot] = (h >> 32 << 32) | <uint64_t> (i - 16 + 1)
            if i < self.count:
                next_hash = hash_row(rows + i * self.words, self.words)
                hashes[i & 15] = next_hash
                prefetch(table + (next_hash & mask))
        release(&self.table_memory)
        self.table_memory = memory
        self.table = table
        self.mask = mask
        return 0

    cdef int insert(self, const uint64_t* rows, Py_ssize_t n, int32_t* ids) noexcept nogil:
        """Insert n rows that are stored one after the other.

        Returns 0, 1 (memory ended) or 2 (too many states).
        """
        cdef uint64_t hashes[INSERT_CHUNK]
        cdef int words = self.words
        cdef Py_ssize_t begin = 0, size, i
        cdef uint64_t h, entry, slot, mask
        cdef uint64_t* stored
        cdef const uint64_t* row
        while begin < n:
            size = min(n - begin, <Py_ssize_t> INSERT_CHUNK)
            if (<uint64_t> (self.count + size) * 5 > (self.mask + 1) * 3
                    and self._grow_table(2 * (self.mask + 1))):
                return 1
            if reserve(&self.rows, <size_t> (self.count + size) * words * 8):
                return 1
            if self.count + size > MAX_STATES:
                return 2
            stored = <uint64_t*> self.rows.data
            mask = self.mask
            for i in range(size):
                hashes[i] = hash_row(rows + (begin + i) * words, words)
                prefetch(self.table + (hashes[i] & mask))
            for i in range(size):
                entry = self.table[hashes[i] & mask]
                if entry >> 32 == hashes[i] >> 32 and entry:
                    prefetch(stored + ((entry & 0xFFFFFFFFULL) - 1) * words)
            for i in range(size):
                row = rows + (begin + i) * words
                h = hashes[i]
                slot = h & mask
                while True:
                    entry = self.table[slot]
                    if entry == 0:
                        memcpy(stored + self.count * words, row, words * 8)
                        ids[begin + i] = <int32_t> self.count
                        self.count += 1
                        self.table[slot] = (h >> 32 << 32) | <uint64_t> self.count
                        break
                    if (entry >> 32 == h >> 32
                            and rows_equal(stored + ((entry & 0xFFFFFFFFULL) - 1) * words, row,
                                           words)):
                        ids[begin + i] = <int32_t> ((entry & 0xFFFFFFFFULL) - 1)
                        break
                    slot = (slot + 1) & mask
            begin += size
        return 0
