# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Offset-labelled decision diagrams (ODDs) over plain arrays: which number has a member of a set,
and back.

An ODD is the BDD of a set over an ordered list of k levels, with one node per level on each path (a
level that the BDD skips gets a node with both branches alike) and the number of members below each
node. Members are numbered in lexicographic order of their bits. Four arrays hold it, children
before parents:
    depth[M]   which of the k levels (k at the two leaves)
    low, high  the branches; node 0 is the empty set, node 1 the leaf of a member
    count[M]   members below

A diagram (BDD or MTBDD) comes as a node table: level[N], low[N], high[N] and value[leaves]; the
nodes below `leaves` are the leaves, with their values (a BDD has two, of values 0 and 1).
`symcheck.kernels.diagrams.vectors` goes between them and arrays.

Every expansion to an array runs in O(nodes + length): the first placement of a node in the output
is remembered, and later placements are block copies of it.
"""
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint32_t, uint64_t, uint8_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcpy, memset

from symcheck.kernels.tables.memo_table cimport (MemoTable, MemoEntry, memo_close, memo_find,
                                                 memo_is_empty, memo_insert, memo_open)

import numpy as np

__all__ = ["build", "embed", "emit", "rank", "unrank"]

cdef object fault(int64_t status):
    if status == OUT_OF_MEMORY:
        return MemoryError("no memory for the walk over the diagram")
    if status == OVERFLOW:
        return OverflowError("the set has 2**63 states or more")
    if status == FOREIGN_LEVEL:
        return ValueError("the diagram depends on a variable that is not among the levels")
    return ValueError("the set is not a subset of the other")

# ----------------------------------------------------------------------------------------------
# building

cdef struct Growing:
    Table table
    const int32_t* levels
    int32_t k
    MemoTable memo            # (diagram node, depth) -> ODD node
    MemoTable unique          # (low, high), depth -> ODD node
    int32_t* depth
    int32_t* low
    int32_t* high
    int64_t* count
    int64_t used
    int64_t room


cdef int64_t _append(Growing* g, int32_t depth, int32_t low, int32_t high,
                     int64_t count) noexcept nogil:
    cdef int64_t room
    if g.used == g.room:
        room = 2 * g.room
        if room > 0x7FFFFFF0:
            return OUT_OF_MEMORY
        g.depth = <int32_t*>realloc(g.depth, room * 4)
        g.low = <int32_t*>realloc(g.low, room * 4)
        g.high = <int32_t*>realloc(g.high, room * 4)
        g.count = <int64_t*>realloc(g.count, room * 8)
        if g.depth == NULL or g.low == NULL or g.high == NULL or g.count == NULL:
            return OUT_OF_MEMORY
        g.room = room
    g.depth[g.used] = depth
    g.low[g.used] = low
    g.high[g.used] = high
    g.count[g.used] = count
    g.used += 1
    return g.used - 1


cdef int64_t _grow(Growing* g, int32_t node, int32_t depth) noexcept nogil:
    """The ODD node of a diagram node seen from `depth`, or a negative status."""
    cdef int32_t level
    cdef int64_t low, high, result
    cdef uint64_t key
    cdef MemoEntry* entry
    if node < g.table.leaves:
        if g.table.value[node] == 0:
            return 0
        if depth == g.k:
            return 1
    elif depth == g.k:
        return FOREIGN_LEVEL
    key = (<uint64_t><uint32_t>node << 32) | <uint32_t>depth
    entry = memo_find(&g.memo, key, 0)
    if not memo_is_empty(entry):
        return entry.node
    level = g.levels[depth]
    if node >= g.table.leaves and g.table.level[node] < level:
        return FOREIGN_LEVEL
    if node >= g.table.leaves and g.table.level[node] == level:
        low = _grow(g, g.table.low[node], depth + 1)
        if low < 0:
            return low
        high = _grow(g, g.table.high[node], depth + 1)
    else:
        low = high = _grow(g, node, depth + 1)
    if high < 0:
        return high
    result = 0
    if low or high:
        if g.count[low] > INT64_MAX - g.count[high]:
            return OVERFLOW
        entry = memo_find(&g.unique, (<uint64_t>low << 32) | <uint64_t>high, <uint32_t>depth)
        if not memo_is_empty(entry):
            result = entry.node
        else:
            result = _append(g, depth, <int32_t>low, <int32_t>high, g.count[low] + g.count[high])
            if result < 0:
                return result
            entry = memo_insert(&g.unique, (<uint64_t>low << 32) | <uint64_t>high, <uint32_t>depth)
            if entry == NULL:
                return OUT_OF_MEMORY
            entry.node = <int32_t>result
    entry = memo_insert(&g.memo, key, 0)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>result
    return result


def build(const int32_t[::1] level, const int32_t[::1] low, const int32_t[::1] high,
          const double[::1] value, int root, const int32_t[::1] levels):
    """(depth, low, high, count, root) of the ODD of the set of points where the diagram is not 0.

    levels: int32[k], increasing. Raises OverflowError for 2**63 members or more, ValueError where
    the diagram reads a level that is not among `levels`.
    """
    cdef Growing g
    cdef int64_t result = OUT_OF_MEMORY
    cdef int32_t dummy = 0
    memset(&g, 0, sizeof(Growing))
    g.table = Table(&level[0], &low[0], &high[0], &value[0], <int32_t>value.shape[0])
    g.k = <int32_t>levels.shape[0]
    g.levels = &levels[0] if g.k else &dummy
    g.room = 1024
    g.depth = <int32_t*>malloc(g.room * 4)
    g.low = <int32_t*>malloc(g.room * 4)
    g.high = <int32_t*>malloc(g.room * 4)
    g.count = <int64_t*>malloc(g.room * 8)
    try:
        if g.depth == NULL or g.low == NULL or g.high == NULL or g.count == NULL:
            raise MemoryError
        if memo_open(&g.memo, 1024) < 0 or memo_open(&g.unique, 1024) < 0:
            raise MemoryError
        with nogil:
            _append(&g, g.k, 0, 0, 0)
            _append(&g, g.k, 1, 1, 1)
            result = _grow(&g, root, 0)
        if result < 0:
            raise fault(result)
        return (ints(g.depth, g.used), ints(g.low, g.used), ints(g.high, g.used),
                longs(g.count, g.used), int(result))
    finally:
        memo_close(&g.memo)
        memo_close(&g.unique)
        free(g.depth)
        free(g.low)
        free(g.high)
        free(g.count)


cdef object ints(int32_t* data, int64_t n):
    result = np.empty(n, np.int32)
    cdef int32_t[::1] view = result
    if n:
        memcpy(&view[0], data, n * 4)
    return result


cdef object longs(int64_t* data, int64_t n):
    result = np.empty(n, np.int64)
    cdef int64_t[::1] view = result
    if n:
        memcpy(&view[0], data, n * 8)
    return result


cdef Odd odd_of(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
                const int64_t[::1] count):
    return Odd(&depth[0], &low[0], &high[0], &count[0])

# ----------------------------------------------------------------------------------------------
# members as numbers

cdef struct Emission:
    Odd odd
    const int64_t* weights
    int32_t last          # the deepest level with a weight
    int64_t* out
    int64_t* first        # per node: first placement, or -1
    int64_t* base         # ... and the sum of the weights above it


cdef void _emit(Emission* e, int32_t node, int64_t at, int64_t prefix) noexcept nogil:
    cdef int64_t i, n, delta
    cdef int64_t* out
    cdef const int64_t* source
    cdef int32_t depth
    while True:
        depth = e.odd.depth[node]
        out = e.out + at
        n = e.odd.count[node]
        if depth > e.last or node == 1:
            for i in range(n):
                out[i] = prefix
            return
        if e.odd.low[node] == 0:
            prefix += e.weights[depth]
            node = e.odd.high[node]
        elif e.odd.high[node] == 0:
            node = e.odd.low[node]
        else:
            break
    if e.first[node] >= 0:
        source = e.out + e.first[node]
        delta = prefix - e.base[node]
        for i in range(n):
            out[i] = source[i] + delta
        return
    e.first[node] = at
    e.base[node] = prefix
    n = e.odd.count[e.odd.low[node]]
    _emit(e, e.odd.low[node], at, prefix)
    _emit(e, e.odd.high[node], at + n, prefix + e.weights[depth])


def emit(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
         const int64_t[::1] count, int root, const int64_t[::1] weights, int64_t offset,
         int64_t[::1] out):
    """out[i] = offset + sum of weights[d] over the levels d at which bit d of member i is 1
    (wrapping at 2**64).

    Powers of two as weights give packed bits or the value of an integer variable. out:
    int64[count[root]].
    """
    cdef Emission e
    cdef int32_t d
    cdef int64_t i, nodes = depth.shape[0]
    cdef int64_t dummy = 0
    if out.shape[0] != count[root]:
        raise ValueError(f"{out.shape[0]} places for {count[root]} members")
    if out.shape[0] == 0:
        return
    e.odd = odd_of(depth, low, high, count)
    e.weights = &weights[0] if weights.shape[0] else &dummy
    e.out = &out[0]
    e.last = -1
    for d in range(weights.shape[0]):
        if weights[d]:
            e.last = d
    e.first = <int64_t*>malloc(nodes * 8)
    e.base = <int64_t*>malloc(nodes * 8)
    if e.first == NULL or e.base == NULL:
        free(e.first)
        free(e.base)
        raise MemoryError
    with nogil:
        for i in range(nodes):
            e.first[i] = -1
        _emit(&e, root, 0, offset)
    free(e.first)
    free(e.base)


def rank(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
         const int64_t[::1] count, int root, const uint8_t[:, ::1] bits, int64_t[::1] out):
    """out[i] = number of the member with bits[i, :] (uint8[m, k]), or -1 where it is no member."""
    cdef int64_t i, at, m = bits.shape[0]
    cdef int32_t node, k = <int32_t>bits.shape[1], d
    with nogil:
        for i in range(m):
            node = root
            at = 0
            for d in range(k):
                if bits[i, d]:
                    at += count[low[node]]
                    node = high[node]
                else:
                    node = low[node]
                if node == 0:
                    break
            out[i] = at if node else -1


def unrank(const int32_t[::1] depth, const int32_t[::1] low, const int32_t[::1] high,
           const int64_t[::1] count, int root, const int64_t[::1] indices, uint8_t[:, ::1] bits):
    """bits[i, :] = the bits (uint8[m, k]) of member number indices[i]. Raises IndexError for a
    number out of range.
    """
    cdef int64_t i, at, m = indices.shape[0]
    cdef int32_t node, k = <int32_t>bits.shape[1], d
    for i in range(m):
        if indices[i] < 0 or indices[i] >= count[root]:
            raise IndexError(f"no member number {indices[i]} in a set of {count[root]}")
    with nogil:
        for i in range(m):
            node = root
            at = indices[i]
            for d in range(k):
                if at >= count[low[node]]:
                    at -= count[low[node]]
                    bits[i, d] = 1
                    node = high[node]
                else:
                    bits[i, d] = 0
                    node = low[node]

# ----------------------------------------------------------------------------------------------
# subset numbers in a superset

cdef struct Embedding:
    Odd sub
    Odd sup
    MemoTable memo             # (sub node, sup node) -> first placement, base
    int64_t* out


cdef int _embed(Embedding* e, int32_t node, int32_t other, int64_t at, int64_t base) noexcept nogil:
    cdef int64_t i, n, delta
    cdef int64_t* out
    cdef const int64_t* source
    cdef MemoEntry* entry
    cdef uint64_t key
    cdef int status
    out = e.out + at
    n = e.sub.count[node]
    while True:
        if other == 0:
            return NOT_A_SUBSET
        # the same set, if it is a subset at all: then checked by its equal count
        if n == e.sup.count[other]:
            for i in range(n):
                out[i] = base + i
            return 0
        if e.sub.low[node] == 0:
            base += e.sup.count[e.sup.low[other]]
            node = e.sub.high[node]
            other = e.sup.high[other]
        elif e.sub.high[node] == 0:
            node = e.sub.low[node]
            other = e.sup.low[other]
        else:
            break
    key = (<uint64_t><uint32_t>node << 32) | <uint32_t>other
    entry = memo_find(&e.memo, key, 0)
    if not memo_is_empty(entry):
        source = e.out + entry.first
        delta = base - entry.second
        for i in range(n):
            out[i] = source[i] + delta
        return 0
    entry = memo_insert(&e.memo, key, 0)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.first = at
    entry.second = base
    status = _embed(e, e.sub.low[node], e.sup.low[other], at, base)
    if status < 0:
        return status
    return _embed(e, e.sub.high[node], e.sup.high[other], at + e.sub.count[e.sub.low[node]],
                  base + e.sup.count[e.sup.low[other]])


def embed(sub, sup, int64_t[::1] out):
    """out[i] = number in `sup` of member i of `sub`. Both are (depth, low, high, count, root) over
    the same levels.

    `sub` must be a subset of `sup`; ValueError where the walk meets a member that is missing.
    """
    cdef Embedding e
    cdef const int32_t[::1] depth = sub[0], low = sub[1], high = sub[2], depth2 = sup[0]
    cdef const int32_t[::1] low2 = sup[1], high2 = sup[2]
    cdef const int64_t[::1] count = sub[3], count2 = sup[3]
    cdef int32_t root = sub[4], root2 = sup[4]
    cdef int status
    if out.shape[0] != count[root]:
        raise ValueError(f"{out.shape[0]} places for {count[root]} members")
    if out.shape[0] == 0:
        return
    e.sub = odd_of(depth, low, high, count)
    e.sup = odd_of(depth2, low2, high2, count2)
    e.out = &out[0]
    if memo_open(&e.memo, 1024) < 0:
        raise MemoryError
    with nogil:
        status = _embed(&e, root, root2, 0, 0)
    memo_close(&e.memo)
    if status < 0:
        raise fault(status)
