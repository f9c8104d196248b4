# cython: language_level=3
"""A hash table for memoised recursions over diagrams, with open addressing.

It maps a 64-bit key and a 32-bit extra key to one int32 and two int64. An entry is empty when its
key and extra key are all ones; no recursion uses this key, because node numbers stay below 2**31.
"""
from libc.stdint cimport int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.tables.hash_mix cimport mix_pair

cdef struct MemoEntry:
    uint64_t key
    uint32_t extra
    int32_t node
    int64_t first

cdef struct MemoTable:
    MemoEntry* entries
    int64_t capacity      # a power of two
    int64_t count

cdef inline bint memo_is_empty(MemoEntry* entry) noexcept nogil:
    """Whether an entry holds nothing."""
    return entry.key == <uint64_t>-1 and entry.extra == <uint32_t>-1

cdef inline int memo_open(MemoTable* memo, int64_t capacity) noexcept nogil:
    """Allocate an empty table for `capacity` (a power of two) entries; -1 when memory ends."""
    memo.entries = <MemoEntry*>malloc(capacity * sizeof(MemoEntry))
    memo.capacity = capacity
    memo.count = 0
    if memo.entries == NULL:
        return -1
    memset(memo.entries, 0xFF, capacity * sizeof(MemoEntry))
    return 0

cdef inline void memo_close(MemoTable* memo) noexcept nogil:
    """Free the table."""
    free(memo.entries)
    memo.entries = NULL

cdef inline MemoEntry* memo_find(MemoTable* memo, uint64_t key, uint32_t extra) noexcept nogil:
    """The entry of the key, or the empty entry where it belongs."""
    cdef int64_t mask = memo.capacity - 1
    cdef int64_t i = <int64_t>mix_pair(key, extra) & mask
    cdef MemoEntry* entry
    while True:
        entry = &memo.entries[i]
        if (entry.key == key and entry.extra == extra) or memo_is_empty(entry):
            return entry
        i = (i + 1) & mask

cdef inline int memo_grow(MemoTable* memo) noexcept nogil:
    """Double the capacity; -1 when memory ends."""
    cdef MemoTable larger
    cdef int64_t i
    if memo_open(&larger, memo.capacity * 2) < 0:
        return -1
    for i in range(memo.capacity):
        if not memo_is_empty(&memo.entries[i]):
            memo_find(&larger, memo.entries[i].key, memo.entries[i].extra)[0] = memo.entries[i]
    larger.count = memo.count
    free(memo.entries)
    memo[0] = larger
    return 0

cdef inline MemoEntry* memo_insert(MemoTable* memo, uint64_t key, uint32_t extra) noexcept nogil:
    """Add a key that is not in the table; NULL when memory ends.

    Pointers to entries from before the call become invalid.
    """
    cdef MemoEntry* entry
    if 3 * memo.count >= 2 * memo.capacity:
        if memo_grow(memo) < 0:
            return NULL
    entry = memo_find(memo, key, extra)
    entry.key = key
    entry.extra = extra
    memo.count += 1
    return entry
