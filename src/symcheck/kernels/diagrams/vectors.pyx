# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Between diagrams and arrays over the members of an ODD.

ODDs and diagrams are tuples, as in `symcheck.kernels.diagrams.odd`. A new diagram is a tuple
(level, low, high, root), int32[nodes] three times: leaves come first, with the level `bottom` and
themselves as children; other nodes come after their children. Functions raise MemoryError when
memory ends.
"""
from libc.stdint cimport int32_t, int64_t, uint8_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcmp, memcpy, memset

from symcheck.kernels.diagrams.node_list cimport (NodeList, append_node, node_arrays, release_nodes,
                                                  unique_node)
from symcheck.kernels.diagrams.odd cimport (FOREIGN_LEVEL, MAX_NODES, OUT_OF_MEMORY, Diagram, Odd,
                                            diagram_of, odd_of, pointer_of, walk_error)
from symcheck.kernels.tables.hash_mix cimport double_bits
from symcheck.kernels.tables.memo_table cimport (MemoEntry, MemoTable, memo_close, memo_find,
                                                 memo_insert, memo_is_empty, memo_open)

import numpy as np

__all__ = ["array_to_diagram", "diagram_to_array", "number_values"]

ctypedef fused Id:
    uint8_t
    int32_t



# ------------------------------------------------------------------------------ diagram -> array

cdef struct Expansion:
    Odd odd
    Diagram diagram
    const int32_t* levels
    int32_t k
    MemoTable memo        # (ODD node, diagram node) -> where it was first written
    char* out
    int64_t width         # bytes of an item: 1 or 8


cdef void _fill(Expansion* e, int64_t at, int64_t n, double value) noexcept nogil:
    """Write a value to n members from position `at` on."""
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
    """Write the values of the members below an ODD node; 0 or a negative status."""
    cdef int32_t depth, f0, f1
    cdef int64_t n = e.odd.count[node]
    cdef uint64_t key
    cdef MemoEntry* entry
    cdef int status
    while True:
        if f < e.diagram.leaves:
            _fill(e, at, n, e.diagram.value[f])
            return 0
        depth = e.odd.depth[node]
        if depth == e.k or e.diagram.level[f] < e.levels[depth]:
            return FOREIGN_LEVEL
        if e.diagram.level[f] == e.levels[depth]:
            f0 = e.diagram.low[f]
            f1 = e.diagram.high[f]
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


def diagram_to_array(odd: OddTable, diagram: Diagram, const int32_t[::1] levels, out: Floats | Masks):
    """The values of a diagram at the members of an ODD.

    Args:
        levels: int32[k], ascending, the levels of the ODD in the diagram.
        out: float64[members], receives the values; or uint8[members], receives 1 where the diagram
        is
            not 0. It must hold zeros.
    Raises:
        ValueError: the diagram depends on a level that is not in `levels`.
    """
    cdef Expansion e
    cdef uint8_t[::1] masks
    cdef double[::1] doubles
    cdef int status
    e.odd, e.diagram = odd_of(odd), diagram_of(diagram)
    if len(out) != e.odd.count[e.odd.root]:
        raise ValueError(f"an array of {len(out)} for {e.odd.count[e.odd.root]} members")
    if len(out) == 0:
        return
    if out.dtype == np.float64:
        doubles = out
        e.out = <char*>&doubles[0]
        e.width = 8
    else:
        masks = out
        e.out = <char*>&masks[0]
        e.width = 1
    e.k = <int32_t>levels.shape[0]
    e.levels = pointer_of(levels)
    if memo_open(&e.memo, 1024) < 0:
        raise MemoryError
    with nogil:
        status = _expand(&e, e.odd.root, e.diagram.root, 0)
    memo_close(&e.memo)
    if status < 0:
        raise walk_error(status)

# ------------------------------------------------------------------------------ array -> diagram

cdef struct Writer:
    Odd odd
    const int32_t* levels
    NodeList nodes        # the diagram that is written
    MemoTable memo        # (ODD node, leaf) -> diagram node
    int64_t* last         # where the ODD node was last written, and as what
    int32_t* result


cdef int64_t _node(Writer* w, int32_t level, int64_t low, int64_t high) noexcept nogil:
    """The node with these children, or a negative status."""
    if low < 0 or high < 0:
        return low if low < 0 else high
    return low if low == high else unique_node(&w.nodes, level, low, high)


cdef int _open(Writer* w, tuple odd, const int32_t[::1] levels, int64_t leaves,
               int32_t bottom) except -1:
    """Begin a diagram with its leaves."""
    cdef int64_t i
    memset(w, 0, sizeof(Writer))
    w.odd = odd_of(odd)
    w.levels = pointer_of(levels)
    if memo_open(&w.nodes.unique, 1024) < 0 or memo_open(&w.memo, 1024) < 0:
        raise MemoryError
    for i in range(leaves):
        if append_node(&w.nodes, bottom, i, i) < 0:
            raise MemoryError
    return 0


cdef object _result(Writer* w, int64_t root):
    """The diagram, or the exception for a negative status."""
    if root < 0:
        raise walk_error(root)
    return *node_arrays(&w.nodes), int(root)


cdef void _close(Writer* w) noexcept:
    """Free the memory of a diagram that is written."""
    release_nodes(&w.nodes)
    memo_close(&w.memo)
    free(w.last)
    free(w.result)


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
    if result >= 0:
        entry = memo_insert(&w.memo, key, 0)
        if entry == NULL:
            return OUT_OF_MEMORY
        entry.node = <int32_t>result
    return result


cdef int64_t _vector(Writer* w, const Id* all_ids, int32_t node, int64_t at) noexcept nogil:
    """The diagram of the values of the members below a node, or a negative status."""
    cdef const Id* ids = all_ids + at
    cdef int64_t i = 1, n = w.odd.count[node], first, result
    cdef int32_t low, high, level
    while i < n and ids[i] == ids[0]:
        i += 1
    if i >= n:
        return _constant(w, node, ids[0]) if n else 0
    if w.last[node] >= 0 and memcmp(ids, all_ids + w.last[node], n * sizeof(Id)) == 0:
        return w.result[node]
    low = w.odd.low[node]
    high = w.odd.high[node]
    level = w.levels[w.odd.depth[node]]
    first = _vector(w, all_ids, low, at) if low else 0
    if first < 0:
        return first
    result = _vector(w, all_ids, high, at + w.odd.count[low]) if high else 0
    result = _node(w, level, first, result)
    if result >= 0:
        w.last[node] = at
        w.result[node] = <int32_t>result
    return result


def number_values(const double[::1] values, int32_t[::1] ids) -> Floats:
    """Number the distinct values; value 0 has number 0, and -0.0 counts as 0.

    Args:
        values: float64[n].
        ids: int32[n], receives the number of each value.
    Returns:
        float64[numbers], the value of each number.
    """
    cdef MemoTable memo
    cdef MemoEntry* entry
    cdef int64_t i
    cdef int32_t used = 1, number = 0
    cdef double x
    cdef uint64_t key, previous = 0
    cdef bint failed = False
    if memo_open(&memo, 1024) < 0:
        raise MemoryError
    with nogil:
        memo_insert(&memo, 0, 0).node = 0
        for i in range(values.shape[0]):
            x = values[i]
            key = double_bits(x) if x != 0 else 0
            if key != previous:
                previous = key
                entry = memo_find(&memo, key, 0)
                if memo_is_empty(entry):
                    entry = memo_insert(&memo, key, 0)
                    if entry == NULL or used == MAX_NODES:
                        failed = True
                        break
                    entry.node = used
                    used += 1
                number = entry.node
            ids[i] = number
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


def array_to_diagram(odd: OddTable, const Id[::1] ids, int leaves, const int32_t[::1] levels,
                     int bottom) -> NewDiagram:
    """The diagram of a vector (the set of a mask) over the members of an ODD; it is 0 elsewhere.

    Args:
        ids: int32[members] or uint8[members], the leaf of each member; leaf 0 is the value 0.
        leaves: number of leaves.
        levels: int32[k], ascending, the levels of the ODD in the diagram.
        bottom: level of the leaves.
    Returns:
        level, low, high, root.
    """
    cdef Writer w
    cdef int64_t root = 0, i, nodes = len(odd[0])
    try:
        _open(&w, odd, levels, leaves, bottom)
        if ids.shape[0] != w.odd.count[w.odd.root]:
            raise ValueError(f"{ids.shape[0]} values for {w.odd.count[w.odd.root]} members")
        w.last = <int64_t*>malloc(nodes * 8)
        w.result = <int32_t*>malloc(nodes * 4)
        if w.last == NULL or w.result == NULL:
            raise MemoryError
        for i in range(nodes):
            w.last[i] = -1
        if ids.shape[0]:
            with nogil:
                root = _vector(&w, &ids[0], w.odd.root, 0)
        return _result(&w, root)
    finally:
        _close(&w)
