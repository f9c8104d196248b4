# cython: language_level=3
"""A hash table from pairs of int32 to int32, with open addressing.

The pair (-1, -1) is not a key. A table of zeros is empty and holds no memory.
"""
from libc.stdint cimport uint32_t, uint64_t

from symcheck.kernels.tables.memo_table cimport (MemoEntry, MemoTable, memo_close, memo_find,
                                                 memo_insert, memo_is_empty, memo_open)

ctypedef MemoTable PairMap

cdef inline uint64_t pair_key(int a, int b) noexcept nogil:
    """The pair as one word."""
    return (<uint64_t><uint32_t>a << 32) | <uint32_t>b

cdef inline void pair_map_clear(PairMap* map) noexcept nogil:
    """Remove all pairs and free the memory."""
    memo_close(map)
    map.capacity = 0

cdef inline bint pair_map_find(PairMap* map, int a, int b, int* value) noexcept nogil:
    """Whether the pair is in the table; `value` receives its value."""
    cdef MemoEntry* entry
    if map.capacity == 0:
        return False
    entry = memo_find(map, pair_key(a, b), 0)
    if memo_is_empty(entry):
        return False
    value[0] = entry.node
    return True

cdef inline int pair_map_insert(PairMap* map, int a, int b, int value) noexcept nogil:
    """Add a pair that is not in the table; -1 if memory is short."""
    cdef MemoEntry* entry
    if map.capacity == 0 and memo_open(map, 1024) < 0:
        return -1
    entry = memo_insert(map, pair_key(a, b), 0)
    if entry == NULL:
        return -1
    entry.node = value
    return 0
