# cython: language_level=3
"""A hash table from pairs of int32 to int32, with open addressing.

The pair (-1, -1) is not a key. A table of zeros is empty and holds no memory.
"""
from libc.stdint cimport int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.tables.hash_mix cimport mix

cdef struct PairEntry:
    uint64_t key
    int64_t value

cdef struct PairMap:
    PairEntry* entries
    int64_t capacity      # a power of two, or 0
    int64_t count

cdef inline uint64_t pair_key(int a, int b) noexcept nogil:
    """The pair as one word."""
    return (<uint64_t><uint32_t>a << 32) | <uint32_t>b

cdef inline void pair_map_clear(PairMap* map) noexcept nogil:
    """Remove all pairs and free the memory."""
    free(map.entries)
    map.entries = NULL
    map.capacity = 0
    map.count = 0

cdef inline PairEntry* pair_map_slot(PairMap* map, uint64_t key) noexcept nogil:
    """The entry of the key, or the empty entry where it belongs."""
    cdef int64_t mask = map.capacity - 1
    cdef int64_t i = <int64_t>mix(key) & mask
    while map.entries[i].key != key and map.entries[i].key != <uint64_t>-1:
        i = (i + 1) & mask
    return &map.entries[i]

cdef inline bint pair_map_find(PairMap* map, int a, int b, int* value) noexcept nogil:
    """Whether the pair (a, b) is in the table; `value` receives its value."""
    cdef PairEntry* entry
    cdef uint64_t key = pair_key(a, b)
    if map.capacity == 0:
        return False
    entry = pair_map_slot(map, key)
    if entry.key != key:
        return False
    value[0] = <int>entry.value
    return True

cdef inline int pair_map_grow(PairMap* map) noexcept nogil:
    """Double the capacity; -1 when memory ends."""
    cdef PairMap larger
    cdef int64_t i
    larger.capacity = 1024 if map.capacity == 0 else 2 * map.capacity
    larger.count = map.count
    larger.entries = <PairEntry*>malloc(larger.capacity * sizeof(PairEntry))
    if larger.entries == NULL:
        return -1
    memset(larger.entries, 0xFF, larger.capacity * sizeof(PairEntry))
    for i in range(map.capacity):
        if map.entries[i].key != <uint64_t>-1:
            pair_map_slot(&larger, map.entries[i].key)[0] = map.entries[i]
    free(map.entries)
    map[0] = larger
    return 0

cdef inline int pair_map_insert(PairMap* map, int a, int b, int value) noexcept nogil:
    """Add a pair that is not in the table; -1 when memory ends."""
    cdef PairEntry* entry
    if 2 * map.count >= map.capacity and pair_map_grow(map) < 0:
        return -1
    entry = pair_map_slot(map, pair_key(a, b))
    entry.key = pair_key(a, b)
    entry.value = value
    map.count += 1
    return 0
