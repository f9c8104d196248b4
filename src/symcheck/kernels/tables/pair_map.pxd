# cython: language_level=3
"""A hash table from pairs of int32 to int32, open addressing, in plain C. The pair (-1, -1) is not a key."""
from libc.stdint cimport int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.tables.hash_mix cimport mix

cdef struct Entry:
    uint64_t key
    int64_t value

cdef struct Pairs:
    Entry* entries
    int64_t size      # a power of two, or 0
    int64_t used

cdef inline uint64_t pair_key(int a, int b) noexcept nogil:
    return (<uint64_t><uint32_t>a << 32) | <uint32_t>b

cdef inline void pairs_drop(Pairs* p) noexcept nogil:
    free(p.entries)
    p.entries = NULL
    p.size = 0
    p.used = 0

cdef inline Entry* pairs_slot(Pairs* p, uint64_t key) noexcept nogil:
    cdef int64_t mask = p.size - 1
    cdef int64_t i = <int64_t>mix(key) & mask
    while p.entries[i].key != key and p.entries[i].key != <uint64_t>-1:
        i = (i + 1) & mask
    return &p.entries[i]

cdef inline bint pairs_find(Pairs* p, int a, int b, int* value) noexcept nogil:
    cdef Entry* e
    cdef uint64_t key = pair_key(a, b)
    if p.size == 0:
        return False
    e = pairs_slot(p, key)
    if e.key != key:
        return False
    value[0] = <int>e.value
    return True

cdef inline int pairs_grow(Pairs* p) noexcept nogil:
    cdef Pairs bigger
    cdef int64_t i
    bigger.size = 1024 if p.size == 0 else 2 * p.size
    bigger.used = p.used
    bigger.entries = <Entry*>malloc(bigger.size * sizeof(Entry))
    if bigger.entries == NULL:
        return -1
    memset(bigger.entries, 0xFF, bigger.size * sizeof(Entry))
    for i in range(p.size):
        if p.entries[i].key != <uint64_t>-1:
            pairs_slot(&bigger, p.entries[i].key)[0] = p.entries[i]
    free(p.entries)
    p[0] = bigger
    return 0

cdef inline int pairs_put(Pairs* p, int a, int b, int value) noexcept nogil:
    """Add a pair that is not there; -1 when memory ends."""
    cdef Entry* e
    if 2 * p.used >= p.size and pairs_grow(p) < 0:
        return -1
    e = pairs_slot(p, pair_key(a, b))
    e.key = pair_key(a, b)
    e.value = value
    p.used += 1
    return 0
