# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Between diagrams and arrays over the members of an ODD: values of a diagram, and the diagram of
values.

ODDs and node tables are as in `symcheck.kernels.diagrams.odd`.
"""
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcmp, memcpy, memset

from symcheck.kernels.tables.memo_table cimport (MemoTable, MemoEntry, memo_close, memo_find,
                                                 memo_is_empty, memo_insert, memo_open)
from symcheck.kernels.diagrams.odd cimport (FOREIGN_LEVEL, OUT_OF_MEMORY, Odd, Table, fault, ints,
                                            odd_of)

import numpy as np

__all__ = ["collapse", "expand", "number", "vector_table"]

# ----------------------------------------------------------------------------------------------
# diagram -> array

cdef struct Expansion:
    Odd odd
    Table table
    const int32_t* levels
    int32_t k
    MemoTable memo             # (ODD node, diagram node) -> first placement
    char* out
    int64_t width         # bytes of an item: 1 or 8


cdef void _fill(Expansion* e, int64_t at, int64_t n, double value) noexcept nogil:
    cdef int64_t i
    cdef double* out
    if value == 0:        # the output starts as zeros: untouched pages are never allocated
        return
    if e.width == 1:
        memset(e.out + at, 1, n)
        return
    out = <double*>e.out + at
    for i in range(n):
        out[i] = value


cdef int _expand(Expansion* e, int32_t node, int32_t f, int64_t at) noexcept nogil:
    cdef int32_t depth, f0, f1
    cdef int64_t n = e.odd.count[node]
    cdef uint64_t key
    cdef MemoEntry* entry
    cdef int status
    while True:
        if f < e.table.leaves:
            _fill(e, at, n, e.table.value[f])
            return 0
        depth = e.odd.depth[node]
        if depth == e.k or e.table.level[f] < e.levels[depth]:
            return FOREIGN_LEVEL
        if e.table.level[f] == e.levels[depth]:
            f0 = e.table.low[f]
            f1 = e.table.high[f]
        else:
            f0 = f1 = f
        if e.odd.low[node] == 0:
            node = e.odd.high[node]
            f = f1
        elif e.odd.high[node] == 0:
            node = e.odd.low[node]
            f = f0
        else:
            break
    key = (<uint64_t><uint32_t>node << 32) | <uint32_t>f
    entry = memo_find(&e.memo, key, 0)
    if not memo_is_empty(entry):
        memcpy(e.out + at * e.width, e.out + entry.first * e.width, n * e.width)
        return 0
    entry = memo_insert(&e.memo, key, 0)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.first = at
    status = _expand(e, e.odd.low[node], f0, at)
    if status < 0:
        return status
    return _expand(e, e.odd.high[node], f1, at + e.odd.count[e.odd.low[node]])


def expand(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
           const int64_t[::1] count, int root, const int32_t[::1] level, const int32_t[::1] tlow,
           const int32_t[::1] thigh, const double[::1] value, int troot, const int32_t[::1] levels,
           out):
    """out[i] = value of the diagram at member i. out: float64[n], or uint8[n] (1 where the diagram
    is not 0); zeroed before.
    """
    cdef Expansion e
    cdef uint8_t[::1] bytes_
    cdef double[::1] doubles
    cdef int status
    cdef int32_t dummy = 0
    if len(out) != count[root]:
        raise ValueError(f"{len(out)} places for {count[root]} members")
    if len(out) == 0:
        return
    if out.dtype == np.float64:
        doubles = out
        e.out = <char*>&doubles[0]
        e.width = 8
    else:
        bytes_ = out
        e.out = <char*>&bytes_[0]
        e.width = 1
    e.odd = odd_of(depth, low, high, count)
    e.table = Table(&level[0], &tlow[0], &thigh[0], &value[0], <int32_t>value.shape[0])
    e.k = <int32_t>levels.shape[0]
    e.levels = &levels[0] if e.k else &dummy
    if memo_open(&e.memo, 1024) < 0:
        raise MemoryError
    with nogil:
        status = _expand(&e, root, troot, 0)
    memo_close(&e.memo)
    if status < 0:
        raise fault(status)

# ----------------------------------------------------------------------------------------------
# array -> diagram

cdef struct Writer:
    Odd odd
    const int32_t* levels
    int32_t* level        # the diagram being written
    int32_t* low
    int32_t* high
    int64_t used
    int64_t room
    MemoTable unique           # (low, high), level -> diagram node
    # collapse: (pattern, ODD node); vectors: (ODD node, constant) -> diagram node
    MemoTable memo
    int32_t* whole        # collapse: the diagram node of an ODD node's set, or -1
    const uint64_t* bits
    const int32_t* ids
    int64_t* last         # vectors: where the ODD node was last written, and as what
    int32_t* result


cdef int64_t _node(Writer* w, int32_t level, int64_t low, int64_t high) noexcept nogil:
    cdef MemoEntry* entry
    cdef int64_t room
    cdef uint64_t key
    if low < 0 or high < 0:
        return low if low < 0 else high
    if low == high:
        return low
    key = (<uint64_t>low << 32) | <uint64_t>high
    entry = memo_find(&w.unique, key, <uint32_t>level)
    if not memo_is_empty(entry):
        return entry.node
    if w.used == w.room:
        room = 2 * w.room
        if room > 0x7FFFFFF0:
            return OUT_OF_MEMORY
        w.level = <int32_t*>realloc(w.level, room * 4)
        w.low = <int32_t*>realloc(w.low, room * 4)
        w.high = <int32_t*>realloc(w.high, room * 4)
        if w.level == NULL or w.low == NULL or w.high == NULL:
            return OUT_OF_MEMORY
        w.room = room
    w.level[w.used] = level
    w.low[w.used] = <int32_t>low
    w.high[w.used] = <int32_t>high
    entry = memo_insert(&w.unique, key, <uint32_t>level)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>w.used
    w.used += 1
    return w.used - 1


cdef int64_t _whole(Writer* w, int32_t node) noexcept nogil:
    cdef int64_t result
    if w.whole[node] >= 0:
        return w.whole[node]
    result = _node(w, w.levels[w.odd.depth[node]], _whole(w, w.odd.low[node]),
                   _whole(w, w.odd.high[node]))
    if result >= 0:
        w.whole[node] = <int32_t>result
    return result


cdef inline uint64_t _window(Writer* w, int64_t at, int64_t n) noexcept nogil:
    """Bits at .. at+n, for n <= 64; the array has a spare word at its end."""
    cdef int64_t word = at >> 6
    cdef int shift = <int>(at & 63)
    cdef uint64_t bits = w.bits[word] >> shift
    if shift:
        bits |= w.bits[word + 1] << (64 - shift)
    if n < 64:
        bits &= ((<uint64_t>1) << n) - 1
    return bits


cdef int64_t _small(Writer* w, int32_t node, uint64_t pattern) noexcept nogil:
    cdef int64_t n = w.odd.count[node], half, result
    cdef uint64_t full = <uint64_t>-1 if n == 64 else ((<uint64_t>1) << n) - 1
    cdef int32_t low, high, level
    cdef MemoEntry* entry
    if pattern == 0:
        return 0
    if pattern == full:
        return _whole(w, node)
    entry = memo_find(&w.memo, pattern, <uint32_t>node)
    if not memo_is_empty(entry):
        return entry.node
    low = w.odd.low[node]
    high = w.odd.high[node]
    level = w.levels[w.odd.depth[node]]
    half = w.odd.count[low]
    if low == 0:
        result = _node(w, level, 0, _small(w, high, pattern))
    elif high == 0:
        result = _node(w, level, _small(w, low, pattern), 0)
    else:                 # 0 < half < 64
        result = _node(w, level, _small(w, low, pattern & (((<uint64_t>1) << half) - 1)),
                       _small(w, high, pattern >> half))
    if result < 0:
        return result
    entry = memo_insert(&w.memo, pattern, <uint32_t>node)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>result
    return result


cdef bint _uniform(Writer* w, int64_t at, int64_t n, uint64_t bits) noexcept nogil:
    """Are the n bits from `at` all as those of the word `bits` (all zeros or all ones)?"""
    cdef int64_t i = at, end = at + n
    while end - i >= 64:
        if _window(w, i, 64) != bits:
            return False
        i += 64
    return end == i or _window(w, i, end - i) == bits & (((<uint64_t>1) << (end - i)) - 1)


cdef int64_t _collapse(Writer* w, int32_t node, int64_t at) noexcept nogil:
    cdef int64_t n = w.odd.count[node]
    cdef uint64_t start
    cdef int32_t low, high, level
    if n <= 64:
        return _small(w, node, _window(w, at, n)) if n else 0
    start = _window(w, at, 64)
    if start == 0 and _uniform(w, at, n, 0):
        return 0
    if start == <uint64_t>-1 and _uniform(w, at, n, <uint64_t>-1):
        return _whole(w, node)
    return _split(w, node, at)


cdef int64_t _split(Writer* w, int32_t node, int64_t at) noexcept nogil:
    """A block that is known to be mixed: a level with one branch need not look again."""
    cdef int32_t low = w.odd.low[node], high = w.odd.high[node], level = w.levels[w.odd.depth[node]]
    cdef int64_t first
    if low == 0:
        return _node(w, level, 0, _split(w, high, at))
    if high == 0:
        return _node(w, level, _split(w, low, at), 0)
    first = _collapse(w, low, at)
    if first < 0:
        return first
    return _node(w, level, first, _collapse(w, high, at + w.odd.count[low]))


cdef int _open(Writer* w, int64_t leaves, int32_t bottom) except -1:
    cdef int64_t i
    w.room = leaves + 1024
    w.level = <int32_t*>malloc(w.room * 4)
    w.low = <int32_t*>malloc(w.room * 4)
    w.high = <int32_t*>malloc(w.room * 4)
    if (w.level == NULL or w.low == NULL or w.high == NULL or memo_open(&w.unique, 1024) < 0
            or memo_open(&w.memo, 1024) < 0):
        raise MemoryError
    for i in range(leaves):
        w.level[i] = bottom
        w.low[i] = w.high[i] = <int32_t>i
    w.used = leaves
    return 0


cdef void _close(Writer* w) noexcept:
    memo_close(&w.unique)
    memo_close(&w.memo)
    free(w.level)
    free(w.low)
    free(w.high)
    free(w.whole)
    free(w.last)
    free(w.result)


def collapse(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
             const int64_t[::1] count, int root, const uint64_t[::1] bits,
             const int32_t[::1] levels, int bottom):
    """The BDD of the members whose bit is set, as a node table (level, low, high, root).

    Nodes 0 and 1 are the leaves, of level `bottom` and their own children; other children come
    before their parents.

    bits: member i is bit i % 64 of word i // 64; one spare word at the end. Blocks of equal bits
    cost one look at their words; blocks of up to 64 members are memoised by their content.
    """
    cdef Writer w
    cdef int64_t result = 0, i, nodes = depth.shape[0]
    memset(&w, 0, sizeof(Writer))
    if bits.shape[0] * 64 < count[root] + 64:
        raise ValueError("too few words of bits")
    w.odd = odd_of(depth, low, high, count)
    w.levels = &levels[0] if levels.shape[0] else NULL
    w.bits = &bits[0]
    w.whole = <int32_t*>malloc(nodes * 4)
    try:
        if w.whole == NULL:
            raise MemoryError
        for i in range(nodes):
            w.whole[i] = -1
        w.whole[0] = 0
        w.whole[1] = 1
        _open(&w, 2, bottom)
        with nogil:
            result = _collapse(&w, root, 0)
        if result < 0:
            raise fault(result)
        return ints(w.level, w.used), ints(w.low, w.used), ints(w.high, w.used), int(result)
    finally:
        _close(&w)


cdef int64_t _constant(Writer* w, int32_t node, int32_t value) noexcept nogil:
    """The diagram that is leaf `value` on the set of the ODD node and 0 elsewhere."""
    cdef MemoEntry* entry
    cdef int64_t result
    cdef uint64_t key
    if node == 0 or value == 0:
        return 0
    if node == 1:
        return value
    key = (<uint64_t><uint32_t>node << 32) | <uint32_t>value
    entry = memo_find(&w.memo, key, 0)
    if not memo_is_empty(entry):
        return entry.node
    result = _node(w, w.levels[w.odd.depth[node]], _constant(w, w.odd.low[node], value),
                   _constant(w, w.odd.high[node], value))
    if result < 0:
        return result
    entry = memo_insert(&w.memo, key, 0)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>result
    return result


cdef int64_t _vector(Writer* w, int32_t node, int64_t at) noexcept nogil:
    cdef const int32_t* ids = w.ids + at
    cdef int64_t i = 1, n = w.odd.count[node], first, result
    cdef int32_t low, high, level
    while i < n and ids[i] == ids[0]:
        i += 1
    if i >= n:
        return _constant(w, node, ids[0]) if n else 0
    if w.last[node] >= 0 and memcmp(ids, w.ids + w.last[node], n * 4) == 0:
        return w.result[node]
    low = w.odd.low[node]
    high = w.odd.high[node]
    level = w.levels[w.odd.depth[node]]
    first = _vector(w, low, at) if low else 0
    if first < 0:
        return first
    result = _node(w, level, first, _vector(w, high, at + w.odd.count[low]) if high else 0)
    if result >= 0:
        w.last[node] = at
        w.result[node] = <int32_t>result
    return result


def number(const double[::1] values, int32_t[::1] ids):
    """Number the distinct values: ids[i] is the index of values[i] in the result (float64, first
    entry 0). -0.0 counts as 0.
    """
    cdef MemoTable memo
    cdef MemoEntry* entry
    cdef int64_t i, n = values.shape[0]
    cdef int32_t used = 1
    cdef double x
    cdef uint64_t key, previous = 0
    cdef int32_t id_ = 0
    cdef bint failed = False
    if memo_open(&memo, 1024) < 0:
        raise MemoryError
    with nogil:
        entry = memo_insert(&memo, 0, 0)
        entry.node = 0
        for i in range(n):
            x = values[i]
            if x == 0:
                x = 0.0
            memcpy(&key, &x, 8)
            if key != previous:
                previous = key
                entry = memo_find(&memo, key, 0)
                if memo_is_empty(entry):
                    entry = memo_insert(&memo, key, 0)
                    if entry == NULL or used == 0x7FFFFFF0:
                        failed = True
                        break
                    entry.node = used
                    used += 1
                id_ = entry.node
            ids[i] = id_
    if failed:
        memo_close(&memo)
        raise MemoryError
    leaves = np.zeros(used, np.float64)
    cdef double[::1] view = leaves
    for i in range(memo.capacity):
        if not memo_is_empty(&memo.entries[i]):
            memcpy(&view[memo.entries[i].node], &memo.entries[i].key, 8)
    memo_close(&memo)
    return leaves


def vector_table(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
                 const int64_t[::1] count, int root, const int32_t[::1] ids, int leaves,
                 const int32_t[::1] levels, int bottom):
    """The MTBDD of a vector over the members, 0 elsewhere: (level, low, high, root); leaves as in
    `collapse`.

    ids: int32[n], the number of each member's value, where 0 is the value 0. Blocks of one value
    cost one comparison run.
    """
    cdef Writer w
    cdef int64_t result = 0, i, nodes = depth.shape[0]
    memset(&w, 0, sizeof(Writer))
    if ids.shape[0] != count[root]:
        raise ValueError(f"{ids.shape[0]} values for {count[root]} members")
    w.odd = odd_of(depth, low, high, count)
    w.levels = &levels[0] if levels.shape[0] else NULL
    w.ids = &ids[0] if ids.shape[0] else NULL
    w.last = <int64_t*>malloc(nodes * 8)
    w.result = <int32_t*>malloc(nodes * 4)
    try:
        if w.last == NULL or w.result == NULL:
            raise MemoryError
        for i in range(nodes):
            w.last[i] = -1
        _open(&w, leaves, bottom)
        if ids.shape[0]:
            with nogil:
                result = _vector(&w, root, 0)
        if result < 0:
            raise fault(result)
        return ints(w.level, w.used), ints(w.low, w.used), ints(w.high, w.used), int(result)
    finally:
        _close(&w)
