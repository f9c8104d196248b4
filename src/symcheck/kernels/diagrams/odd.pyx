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
from libc.string cimport memset

from symcheck.kernels.diagrams.node_list cimport (NodeList, append_node, node_arrays, release_nodes,
                                                  unique_node)
from symcheck.kernels.memory cimport Buffer, array_of, release, reserve
from symcheck.kernels.tables.memo_table cimport (MemoEntry, MemoTable, memo_close, memo_find,
                                                 memo_insert, memo_is_empty, memo_open)

import numpy as np

__all__ = ["build", "rank", "unrank"]

cdef object walk_error(int64_t status):
    """The exception for a negative status."""
    if status == OUT_OF_MEMORY:
        return MemoryError("no memory for the traversal of the diagram")
    if status == OVERFLOW:
        return OverflowError("the set has 2**63 states or more")
    return ValueError("the diagram depends on a variable that is not among the levels")


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


# ------------------------------------------------------------------------------------ construction

cdef struct OddBuilder:
    Diagram diagram
    const int32_t* levels
    int32_t k
    MemoTable memo       # (diagram node, depth) -> ODD node
    NodeList nodes       # levels are depths
    Buffer count


cdef int64_t _build_node(OddBuilder* b, int32_t node, int32_t depth) noexcept nogil:
    """The ODD node of a diagram node seen from `depth`, or a negative status."""
    cdef Diagram* d = &b.diagram
    cdef int32_t level
    cdef int64_t low, high, count_low, count_high, number, result
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
        number = b.nodes.count
        result = unique_node(&b.nodes, depth, low, high)
        if result < 0:
            return result
        if result == number:       # a new node
            if reserve(&b.count, 8 * (number + 1)):
                return OUT_OF_MEMORY
            (<int64_t*>b.count.data)[number] = count_low + count_high
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
    cdef int64_t number, result
    memset(&b, 0, sizeof(OddBuilder))
    b.diagram = diagram_of(diagram)
    b.k = <int32_t>levels.shape[0]
    b.levels = pointer_of(levels)
    try:
        if memo_open(&b.memo, 1024) < 0 or memo_open(&b.nodes.unique, 1024) < 0:
            raise MemoryError
        if reserve(&b.count, 16):
            raise MemoryError
        with nogil:
            for number in range(2):        # no member, and the empty row
                (<int64_t*>b.count.data)[number] = number
                result = append_node(&b.nodes, b.k, number, number)
            if result >= 0:
                result = _build_node(&b, b.diagram.root, 0)
        if result < 0:
            raise walk_error(result)
        count = array_of(b.count.data, b.nodes.count, np.int64)
        return *node_arrays(&b.nodes), count, int(result)
    finally:
        memo_close(&b.memo)
        release_nodes(&b.nodes)
        release(&b.count)

# ------------------------------------------------------------------------------ numbers of members

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
