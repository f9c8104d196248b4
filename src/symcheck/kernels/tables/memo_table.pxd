# cython: language_level=3
"""A hash table for memoised walks: (64-bit key, 32-bit extra) -> one int32 and two int64, open addressing, in plain C.

A slot is free when its key and extra are both all ones, which no walk uses: node numbers stay below 2**31.
"""
from libc.stdint cimport int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from symcheck.kernels.tables.hash_mix cimport mix_with

cdef struct Slot:
    uint64_t key
    uint32_t extra
    int32_t node
    int64_t a
    int64_t b

cdef struct Memo:
    Slot* slots
    int64_t size      # a power of two
    int64_t used

cdef inline bint memo_free(Slot* slot) noexcept nogil:
    return slot.key == <uint64_t>-1 and slot.extra == <uint32_t>-1

cdef inline int memo_open(Memo* memo, int64_t size) noexcept nogil:
    memo.slots = <Slot*>malloc(size * sizeof(Slot))
    memo.size = size
    memo.used = 0
    if memo.slots == NULL:
        return -1
    memset(memo.slots, 0xFF, size * sizeof(Slot))
    return 0

cdef inline void memo_close(Memo* memo) noexcept nogil:
    free(memo.slots)
    memo.slots = NULL

cdef inline Slot* memo_find(Memo* memo, uint64_t key, uint32_t extra) noexcept nogil:
    """The slot of the key, or the free slot where it belongs."""
    cdef int64_t mask = memo.size - 1
    cdef int64_t i = <int64_t>mix_with(key, extra) & mask
    cdef Slot* slot
    while True:
        slot = &memo.slots[i]
        if (slot.key == key and slot.extra == extra) or memo_free(slot):
            return slot
        i = (i + 1) & mask

cdef inline int memo_grow(Memo* memo) noexcept nogil:
    cdef Memo bigger
    cdef int64_t i
    if memo_open(&bigger, memo.size * 2) < 0:
        return -1
    for i in range(memo.size):
        if not memo_free(&memo.slots[i]):
            memo_find(&bigger, memo.slots[i].key, memo.slots[i].extra)[0] = memo.slots[i]
    bigger.used = memo.used
    free(memo.slots)
    memo[0] = bigger
    return 0

cdef inline Slot* memo_insert(Memo* memo, uint64_t key, uint32_t extra) noexcept nogil:
    """A new slot for a key that is not in the table; NULL when memory ends. Earlier slot pointers become invalid."""
    cdef Slot* slot
    if 3 * memo.used >= 2 * memo.size:
        if memo_grow(memo) < 0:
            return NULL
    slot = memo_find(memo, key, extra)
    slot.key = key
    slot.extra = extra
    memo.used += 1
    return slot
