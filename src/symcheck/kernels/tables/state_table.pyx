# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Sets of packed states (rows of uint64 words), numbered in the order of their arrival.

Open addressing; an entry holds 32 bits of the hash and the state's number + 1, so that a probe rarely touches a row in
vain. Rows are inserted in chunks whose table places, and then rows, are prefetched: on sets beyond the caches this is
what the speed depends on.
"""

import numpy as np

from libc.stdint cimport int32_t, uint64_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from symcheck.kernels.memory cimport Buffer, prefer_huge_pages, release, reserve

cdef extern from *:
    void __builtin_prefetch(const void*) nogil

cdef enum:
    CHUNK = 256
    LIMIT = 2147483647


cdef inline uint64_t digest(const uint64_t* row, int words) noexcept nogil:
    cdef uint64_t h = 0x9E3779B97F4A7C15ULL
    cdef int w
    for w in range(words):
        h = (h ^ row[w]) * 0xFF51AFD7ED558CCDULL
        h ^= h >> 32
    h *= 0xC4CEB9FE1A85EC53ULL
    return h ^ (h >> 29)


cdef inline bint alike(const uint64_t* a, const uint64_t* b, int words) noexcept nogil:
    cdef int w
    for w in range(words):
        if a[w] != b[w]:
            return False
    return True


cdef class StateSet:
    """An empty set of rows of `words` words."""

    def __cinit__(self, int words):
        self.words = words
        self.count = 0
        self.rows.data = NULL
        self.rows.size = 0
        self.table = NULL
        self.mask = 0
        if self._enlarge(1024):
            raise MemoryError

    def __dealloc__(self):
        release(&self.rows)
        free(self.table)

    def __len__(self):
        return self.count

    @property
    def nbytes(self):
        """Memory held, in bytes."""
        return self.rows.size + (8 * (self.mask + 1) if self.table != NULL else 0)

    def add(self, const uint64_t[:, ::1] rows, int32_t[::1] ids):
        """Insert rows (uint64[n, words]); their numbers go to `ids` (int32[n])."""
        cdef int failed
        if rows.shape[0] == 0:
            return
        if self.table == NULL:
            raise ValueError("the table is dropped")
        with nogil:
            failed = self.insert(&rows[0, 0], rows.shape[0], &ids[0])
        if failed == 1:
            raise MemoryError
        if failed:
            raise OverflowError("more than 2**31 - 1 states")

    def copy_rows(self, uint64_t[:, ::1] out):
        """All rows, in the order of their numbers, into `out` (uint64[count, words])."""
        if self.count:
            memcpy(&out[0, 0], self.rows.data, <size_t> self.count * self.words * 8)

    def drop_table(self):
        """Give the table's memory back: nothing can be inserted any more."""
        free(self.table)
        self.table = NULL

    def view_rows(self):
        """All rows as they are stored, not copied (uint64[count, words]): valid until the next `add`, or `drop_rows`."""
        if self.count == 0:
            return np.empty((0, self.words), np.uint64)
        return np.asarray(<uint64_t[:self.count, :self.words]> <uint64_t*> self.rows.data)

    def drop_rows(self):
        """Give the rows' memory back, and the table's: the set is at its end, and only its length is still known."""
        self.drop_table()
        release(&self.rows)

    cdef int _enlarge(self, uint64_t size) noexcept nogil:
        cdef uint64_t* table = <uint64_t*> calloc(size, 8)
        cdef const uint64_t* rows = <const uint64_t*> self.rows.data
        cdef uint64_t mask = size - 1, h, place, ahead
        cdef long long i
        cdef uint64_t hashes[16]
        if table == NULL:
            return 1
        prefer_huge_pages(table, size * 8)
        for i in range(self.count + 16):
            if i >= 16:
                h = hashes[i & 15]
                place = h & mask
                while table[place]:
                    place = (place + 1) & mask
                table[place] = (h >> 32 << 32) | <uint64_t> (i - 16 + 1)
            if i < self.count:
                ahead = digest(rows + i * self.words, self.words)
                hashes[i & 15] = ahead
                __builtin_prefetch(table + (ahead & mask))
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    cdef int insert(self, const uint64_t* rows, Py_ssize_t n, int32_t* ids) noexcept nogil:
        """Insert n rows that lie one after the other. Gives 0, 1 (no memory) or 2 (too many states)."""
        cdef uint64_t hashes[CHUNK]
        cdef int words = self.words
        cdef Py_ssize_t begin = 0, size, i
        cdef uint64_t h, entry, place, mask
        cdef uint64_t* own
        cdef const uint64_t* row
        while begin < n:
            size = min(n - begin, <Py_ssize_t> CHUNK)
            if <uint64_t> (self.count + size) * 5 > (self.mask + 1) * 3 and self._enlarge(2 * (self.mask + 1)):
                return 1
            if reserve(&self.rows, <size_t> (self.count + size) * words * 8):
                return 1
            if self.count + size > LIMIT:
                return 2
            own = <uint64_t*> self.rows.data
            mask = self.mask
            for i in range(size):
                hashes[i] = digest(rows + (begin + i) * words, words)
                __builtin_prefetch(self.table + (hashes[i] & mask))
            for i in range(size):
                entry = self.table[hashes[i] & mask]
                if entry >> 32 == hashes[i] >> 32 and entry:
                    __builtin_prefetch(own + ((entry & 0xFFFFFFFFULL) - 1) * words)
            for i in range(size):
                row = rows + (begin + i) * words
                h = hashes[i]
                place = h & mask
                while True:
                    entry = self.table[place]
                    if entry == 0:
                        memcpy(own + self.count * words, row, words * 8)
                        ids[begin + i] = <int32_t> self.count
                        self.count += 1
                        self.table[place] = (h >> 32 << 32) | <uint64_t> self.count
                        break
                    if entry >> 32 == h >> 32 and alike(own + ((entry & 0xFFFFFFFFULL) - 1) * words, row, words):
                        ids[begin + i] = <int32_t> ((entry & 0xFFFFFFFFULL) - 1)
                        break
                    place = (place + 1) & mask
            begin += size
        return 0
