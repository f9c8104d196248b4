# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Offset-labelled decision diagrams (ODDs): the number of each member of a set, and back.

An ODD is the BDD of a set over an ordered list of k levels, with one node per level on each path (a
level that the BDD skips gets a node whose branches are equal) and the number of members below each
node. Members are numbered in lexicographic order of their bits. Source: Parker (2002), section 6.3.

An ODD is a tuple (depth, low, high, count, root) with children before parents:
depth: int32[nodes], which of the k levels (k at the two leaves);
low, high: int32[nodes], the branches; node 0 is the empty set, node 1 the leaf of a member;
count: int64[nodes], the number of members below.

A diagram (BDD or MTBDD) is a tuple (level, low, high, value, root), int32[nodes] three times, then
float64[leaves]: the nodes below `leaves` are the leaves, with these values (0 and 1 for a BDD).

Every expansion into an array takes O(nodes + length): where a node was first written is remembered,
and later occurrences are block copies. Functions raise MemoryError when memory ends.
"""
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint32_t, uint64_t, uint8_t
from libc.string cimport memcpy, memset

from symcheck.kernels.memory cimport Buffer, release, reserve
from symcheck.kernels.tables.memo_table cimport (MemoEntry, MemoTable, memo_close, memo_find,
                                                 memo_insert, memo_is_empty, memo_open)

import numpy as np

__all__ = ["build", "embed", "rank", "unrank", "weigh_bits"]

cdef object walk_error(int64_t status):
    """The exception for a negative status."""
    if status == OUT_OF_MEMORY:
        return MemoryError("no memory for the traversal of the diagram")
    if status == OVERFLOW:
        return OverflowError("the set has 2**63 states or more")
    if status == FOREIGN_LEVEL:
        return ValueError("the diagram depends on a variable that is not among the levels")
    return ValueError("the set is not a subset of the other")


cdef const int32_t* pointer_of(const int32_t[::1] array) noexcept:
    """The data of an array; NULL if it is empty."""
    return &array[0] if array.shape[0] else NULL


cdef Diagram diagram_of(tuple diagram):
    """The structure of a diagram, whose arrays the caller keeps."""
    cdef const double[::1] value = diagram[3]
    return Diagram(pointer_of(diagram[0]), pointer_of(diagram[1]), pointer_of(diagram[2]),
                   &value[0], <int32_t>value.shape[0], diagram[4])


cdef Odd odd_of(tuple odd):
    """The structure of an ODD, whose arrays the caller keeps."""
    cdef const int64_t[::1] count = odd[3]
    return Odd(pointer_of(odd[0]), pointer_of(odd[1]), pointer_of(odd[2]), &count[0], odd[4])


cdef object int32_array(const void* data, int64_t n):
    """A numpy copy of n numbers."""
    result = np.empty(n, np.int32)
    cdef int32_t[::1] view = result
    if n:
        memcpy(&view[0], data, n * 4)
    return result

# ------------------------------------------------------------------------------------ construction

cdef struct OddBuilder:
    Diagram diagram
    const int32_t* levels
    int32_t k
    MemoTable memo       # (diagram node, depth) -> ODD node
    MemoTable unique     # (low, high), depth -> ODD node
    Buffer depth, low, high, count
    int64_t nodes


cdef int64_t _append(OddBuilder* b, int32_t depth, int64_t low, int64_t high,
                     int64_t count) noexcept nogil:
    """Add a node; its number, or a negative status."""
    cdef int64_t n = b.nodes
    if (n >= MAX_NODES or reserve(&b.depth, 4 * (n + 1)) or reserve(&b.low, 4 * (n + 1))
            or reserve(&b.high, 4 * (n + 1)) or reserve(&b.count, 8 * (n + 1))):
        return OUT_OF_MEMORY
    (<int32_t*>b.depth.data)[n] = depth
    (<int32_t*>b.low.data)[n] = <int32_t>low
    (<int32_t*>b.high.data)[n] = <int32_t>high
    (<int64_t*>b.count.data)[n] = count
    b.nodes += 1
    return n


cdef int64_t _build_node(OddBuilder* b, int32_t node, int32_t depth) noexcept nogil:
    """The ODD node of a diagram node seen from `depth`, or a negative status."""
    cdef Diagram* d = &b.diagram
    cdef int32_t level
    cdef int64_t low, high, count_low, count_high, result
    cdef uint64_t key
    cdef MemoEntry* entry
    if node < d.leaves:
        if d.value[node] == 0:
            return 0
        if depth == b.k:
            return 1
    elif depth == b.k:
        return FOREIGN_LEVEL
    key = (<uint64_t><uint32_t>node << 32) | <uint32_t>depth
    entry = memo_find(&b.memo, key, 0)
    if not memo_is_empty(entry):
        return entry.node
    level = b.levels[depth]
    if node >= d.leaves and d.level[node] < level:
        return FOREIGN_LEVEL
    if node >= d.leaves and d.level[node] == level:
        low = _build_node(b, d.low[node], depth + 1)
        if low < 0:
            return low
        high = _build_node(b, d.high[node], depth + 1)
    else:
        low = high = _build_node(b, node, depth + 1)
    if high < 0:
        return high
    result = 0
    if low or high:
        count_low, count_high = (<int64_t*>b.count.data)[low], (<int64_t*>b.count.data)[high]
        if count_low > INT64_MAX - count_high:
            return OVERFLOW
        entry = memo_find(&b.unique, (<uint64_t>low << 32) | <uint64_t>high, <uint32_t>depth)
        if not memo_is_empty(entry):
            result = entry.node
        else:
            result = _append(b, depth, low, high, count_low + count_high)
            if result < 0:
                return result
            entry = memo_insert(&b.unique, (<uint64_t>low << 32) | <uint64_t>high, <uint32_t>depth)
            if entry == NULL:
                return OUT_OF_MEMORY
            entry.node = <int32_t>result
    entry = memo_insert(&b.memo, key, 0)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>result
    return result


def build(diagram: Diagram, const int32_t[::1] levels) -> OddTable:
    """The ODD of the set of points where a diagram is not 0.

    Args:
        diagram: as the module says.
        levels: int32[k], ascending.
    Raises:
        OverflowError: the set has 2**63 members or more.
        ValueError: the diagram depends on a level that is not in `levels`.
    """
    cdef OddBuilder b
    cdef int64_t result
    memset(&b, 0, sizeof(OddBuilder))
    b.diagram = diagram_of(diagram)
    b.k = <int32_t>levels.shape[0]
    b.levels = pointer_of(levels)
    try:
        if memo_open(&b.memo, 1024) < 0 or memo_open(&b.unique, 1024) < 0:
            raise MemoryError
        with nogil:
            result = _append(&b, b.k, 0, 0, 0)
            if result >= 0:
                result = _append(&b, b.k, 1, 1, 1)
            if result >= 0:
                result = _build_node(&b, b.diagram.root, 0)
        if result < 0:
            raise walk_error(result)
        count = np.empty(b.nodes, np.int64)
        count[:] = <int64_t[:b.nodes]> <int64_t*> b.count.data
        return (int32_array(b.depth.data, b.nodes), int32_array(b.low.data, b.nodes),
                int32_array(b.high.data, b.nodes), count, int(result))
    finally:
        memo_close(&b.memo)
        memo_close(&b.unique)
        release(&b.depth)
        release(&b.low)
        release(&b.high)
        release(&b.count)

# ------------------------------------------------------------------------------ numbers of members

cdef struct Weighing:
    Odd odd
    const int64_t* weights
    int32_t last          # the deepest level with a weight
    int64_t* out
    int64_t* first        # per node: where it was first written, or -1
    int64_t* base         # ... and the sum of the weights above it


cdef void _weigh(Weighing* w, int32_t node, int64_t at, int64_t prefix) noexcept nogil:
    """Write the sums of the members below a node from position `at` on."""
    cdef int64_t i, n, delta
    cdef int64_t* out
    cdef const int64_t* source
    cdef int32_t depth
    while True:
        depth = w.odd.depth[node]
        out = w.out + at
        n = w.odd.count[node]
        if depth > w.last or node == 1:
            for i in range(n):
                out[i] = prefix
            return
        if w.odd.low[node] == 0:
            prefix += w.weights[depth]
            node = w.odd.high[node]
        elif w.odd.high[node] == 0:
            node = w.odd.low[node]
        else:
            break
    if w.first[node] >= 0:
        source = w.out + w.first[node]
        delta = prefix - w.base[node]
        for i in range(n):
            out[i] = source[i] + delta
        return
    w.first[node] = at
    w.base[node] = prefix
    n = w.odd.count[w.odd.low[node]]
    _weigh(w, w.odd.low[node], at, prefix)
    _weigh(w, w.odd.high[node], at + n, prefix + w.weights[depth])


def weigh_bits(odd: OddTable, const int64_t[::1] weights, int64_t offset, int64_t[::1] out):
    """For each member, the offset plus the weights of its bits that are 1, modulo 2**64.

    Powers of two as weights give packed bits or the value of an integer variable.

    Args:
        weights: int64[k].
        out: int64[members], receives the sums.
    """
    cdef Weighing w
    cdef int32_t d
    cdef int64_t[::1] first, base
    w.odd = odd_of(odd)
    if out.shape[0] != w.odd.count[w.odd.root]:
        raise ValueError(f"an array of {out.shape[0]} for {w.odd.count[w.odd.root]} members")
    if out.shape[0] == 0:
        return
    w.weights = &weights[0] if weights.shape[0] else NULL
    w.out = &out[0]
    w.last = -1
    for d in range(weights.shape[0]):
        if weights[d]:
            w.last = d
    first, base = np.full(len(odd[0]), -1, np.int64), np.empty(len(odd[0]), np.int64)
    w.first, w.base = &first[0], &base[0]
    with nogil:
        _weigh(&w, w.odd.root, 0, offset)


def rank(odd: OddTable, const uint8_t[:, ::1] bits, int64_t[::1] out):
    """The numbers of members.

    Args:
        bits: uint8[m, k].
        out: int64[m], receives the number of the member with these bits, -1 if there is none.
    """
    cdef Odd o = odd_of(odd)
    cdef int64_t i, number
    cdef int32_t node, d
    with nogil:
        for i in range(bits.shape[0]):
            node = o.root
            number = 0
            for d in range(bits.shape[1]):
                if bits[i, d]:
                    number += o.count[o.low[node]]
                    node = o.high[node]
                else:
                    node = o.low[node]
                if node == 0:
                    break
            out[i] = number if node else -1


def unrank(odd: OddTable, const int64_t[::1] indices, uint8_t[:, ::1] bits):
    """The bits of members.

    Args:
        indices: int64[m], numbers of members.
        bits: uint8[m, k], receives their bits.
    Raises:
        IndexError: a number is out of range.
    """
    cdef Odd o = odd_of(odd)
    cdef int64_t i, number, m = indices.shape[0]
    cdef int32_t node, d
    for i in range(m):
        if indices[i] < 0 or indices[i] >= o.count[o.root]:
            raise IndexError(f"no member number {indices[i]} in a set of {o.count[o.root]}")
    with nogil:
        for i in range(m):
            node = o.root
            number = indices[i]
            for d in range(bits.shape[1]):
                bits[i, d] = number >= o.count[o.low[node]]
                if bits[i, d]:
                    number -= o.count[o.low[node]]
                    node = o.high[node]
                else:
                    node = o.low[node]

# --------------------------------------------------------------- numbers of a subset in a superset

cdef struct Embedding:
    Odd subset
    Odd superset
    MemoTable memo        # (subset node, superset node) -> where it was first written, base
    int64_t* out


cdef int _embed(Embedding* e, int32_t node, int32_t other, int64_t at, int64_t base) noexcept nogil:
    """Write the numbers of the members below `node`; returns 0 or a negative status."""
    cdef int64_t i, n, delta
    cdef int64_t* out
    cdef const int64_t* source
    cdef const Odd* a = &e.subset
    cdef const Odd* b = &e.superset
    cdef MemoEntry* entry
    cdef uint64_t key
    cdef int status
    out = e.out + at
    n = a.count[node]
    while True:
        if other == 0:
            return NOT_A_SUBSET
        if n == b.count[other]:      # equal sets, if the one is a subset of the other at all
            for i in range(n):
                out[i] = base + i
            return 0
        if a.low[node] == 0:
            base += b.count[b.low[other]]
            node = a.high[node]
            other = b.high[other]
        elif a.high[node] == 0:
            node = a.low[node]
            other = b.low[other]
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
    status = _embed(e, a.low[node], b.low[other], at, base)
    if status < 0:
        return status
    return _embed(e, a.high[node], b.high[other], at + a.count[a.low[node]],
                  base + b.count[b.low[other]])


def embed(subset: OddTable, superset: OddTable, int64_t[::1] out):
    """The numbers that the members of a set have in a superset over the same levels.

    Args:
        subset, superset: ODDs.
        out: int64[members of the subset], receives the numbers.
    Raises:
        ValueError: the traversal meets a member that is not in the superset.
    """
    cdef Embedding e
    cdef int status
    e.subset, e.superset = odd_of(subset), odd_of(superset)
    if out.shape[0] != e.subset.count[e.subset.root]:
        raise ValueError(f"an array of {out.shape[0]} for {e.subset.count[e.subset.root]} members")
    if out.shape[0] == 0:
        return
    e.out = &out[0]
    if memo_open(&e.memo, 1024) < 0:
        raise MemoryError
    with nogil:
        status = _embed(&e, e.subset.root, e.superset.root, 0, 0)
    memo_close(&e.memo)
    if status < 0:
        raise walk_error(status)
