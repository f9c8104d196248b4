# cython: language_level=3
"""The nodes of a diagram under construction, as arrays that grow; each content is stored once."""
from libc.stdint cimport int32_t, int64_t, uint32_t, uint64_t

from symcheck.kernels.diagrams.odd cimport MAX_NODES, OUT_OF_MEMORY
from symcheck.kernels.memory cimport Buffer, array_of, release, reserve
from symcheck.kernels.tables.memo_table cimport (MemoEntry, MemoTable, memo_close, memo_find,
                                                 memo_insert, memo_is_empty)

cdef struct NodeList:
    Buffer level, low, high
    int64_t count
    MemoTable unique      # (low, high), level -> node

cdef inline int64_t append_node(NodeList* nodes, int32_t level, int64_t low,
                                int64_t high) noexcept nogil:
    """Add a node; its number, or a negative status."""
    cdef int64_t n = nodes.count
    if (n >= MAX_NODES or reserve(&nodes.level, 4 * (n + 1)) or reserve(&nodes.low, 4 * (n + 1))
            or reserve(&nodes.high, 4 * (n + 1))):
        return OUT_OF_MEMORY
    (<int32_t*>nodes.level.data)[n] = level
    (<int32_t*>nodes.low.data)[n] = <int32_t>low
    (<int32_t*>nodes.high.data)[n] = <int32_t>high
    nodes.count += 1
    return n

cdef inline int64_t unique_node(NodeList* nodes, int32_t level, int64_t low,
                                int64_t high) noexcept nogil:
    """The node with this content, added if there is none; its number, or a negative status."""
    cdef uint64_t key = (<uint64_t>low << 32) | <uint64_t>high
    cdef MemoEntry* entry = memo_find(&nodes.unique, key, <uint32_t>level)
    cdef int64_t node
    if not memo_is_empty(entry):
        return entry.node
    node = append_node(nodes, level, low, high)
    if node < 0:
        return node
    entry = memo_insert(&nodes.unique, key, <uint32_t>level)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = <int32_t>node
    return node

cdef inline tuple node_arrays(NodeList* nodes):
    """Levels, low and high children of the nodes: int32[count] each."""
    return (array_of(nodes.level.data, nodes.count, "int32"),
            array_of(nodes.low.data, nodes.count, "int32"),
            array_of(nodes.high.data, nodes.count, "int32"))

cdef inline void release_nodes(NodeList* nodes) noexcept:
    """Free the memory."""
    memo_close(&nodes.unique)
    release(&nodes.level)
    release(&nodes.low)
    release(&nodes.high)
