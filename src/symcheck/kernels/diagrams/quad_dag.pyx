# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The quad-DAG: the distinct submatrices of a matrix diagram.

A matrix is an MTBDD over interleaved row and column bits (row bit i above column bit i above row
bit i+1). Its rows are the members of a row ODD, its columns those of a column ODD (see `odd.pyx`),
over the same number k of bits. The triple (diagram node, row node, column node) determines a
submatrix. Each triple is visited once, and each submatrix is stored once: a node is either a *run*
(a constant along `rows` diagonal cells) or up to four edges (node, row, column). Submatrices that
differ only by their position share a node. `symcheck.kernels.blocks.block_matrix` partitions the
DAG into blocks.
"""
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcmp, memset

from symcheck.kernels.diagrams.odd cimport (FOREIGN_LEVEL, OUT_OF_MEMORY, OVERFLOW, diagram_of,
                                            odd_of, pointer_of)
from symcheck.kernels.tables.memo_table cimport (MemoEntry, memo_close, memo_find, memo_insert,
                                                 memo_is_empty, memo_open)

import numpy as np

__all__ = ["QuadDag"]

cdef uint64_t _content_hash(const Node* node) noexcept nogil:
    """Hash of the content of a node."""
    cdef uint64_t h = <uint64_t>(node.value
                                 + 1) * <uint64_t>0x9E3779B97F4A7C15 + <uint64_t>node.rows
    cdef int i
    cdef const Edge* edge
    for i in range(4):
        edge = &node.edges[i]
        h ^= (<uint64_t><uint32_t>edge.node << 32) ^ <uint64_t>edge.row ^ (<uint64_t>edge.col << 17)
        h *= <uint64_t>0xD6E8FEB86659FD93
        h ^= h >> 32
    return h


cdef bint _equal_content(const Node* a, const Node* b) noexcept nogil:
    """Whether two nodes have the same content."""
    return (a.value == b.value and a.rows == b.rows
            and memcmp(a.edges, b.edges, sizeof(a.edges)) == 0)


cdef int _grow_unique(Builder* builder) noexcept nogil:
    """Double the unique table; a negative status when memory ends."""
    cdef int64_t size = 2 * builder.unique_size, i
    cdef uint64_t slot
    free(builder.unique)
    builder.unique = <int32_t*>malloc(size * 4)
    if builder.unique == NULL:
        return OUT_OF_MEMORY
    memset(builder.unique, 0, size * 4)
    builder.unique_size = size
    for i in range(1, builder.node_count):
        slot = _content_hash(&builder.nodes[i]) & (size - 1)
        while builder.unique[slot]:
            slot = (slot + 1) & (size - 1)
        builder.unique[slot] = <int32_t>i
    return 0


cdef int64_t _intern(Builder* builder, Node* node) noexcept nogil:
    """The number of the node with this content, or a negative status."""
    cdef uint64_t slot
    if 2 * builder.node_count >= builder.unique_size:
        if _grow_unique(builder) < 0:
            return OUT_OF_MEMORY
    slot = _content_hash(node) & (builder.unique_size - 1)
    while builder.unique[slot]:
        if _equal_content(&builder.nodes[builder.unique[slot]], node):
            return builder.unique[slot]
        slot = (slot + 1) & (builder.unique_size - 1)
    if builder.node_count == builder.capacity:
        if builder.capacity > 0x3FFFFFFF:
            return OUT_OF_MEMORY
        builder.capacity *= 2
        builder.nodes = <Node*>realloc(builder.nodes, builder.capacity * sizeof(Node))
        if builder.nodes == NULL:
            return OUT_OF_MEMORY
    builder.nodes[builder.node_count] = node[0]
    builder.unique[slot] = <int32_t>builder.node_count
    builder.node_count += 1
    return builder.node_count - 1


cdef int64_t _intern_run(Builder* builder, int64_t length, int32_t value) noexcept nogil:
    """The number of a run, or a negative status."""
    cdef Node node
    memset(&node, 0, sizeof(Node))
    node.entries = length
    node.runs = 1
    node.rows = node.cols = <uint32_t>length
    node.value = value
    return _intern(builder, &node)


cdef int _merge_runs(Builder* builder, Edge* edges, int32_t* quadrants, int n) noexcept nogil:
    """Join runs that continue each other along the diagonal; the edges left, or a negative status.
    """
    cdef int i, j, last
    cdef Node* a
    cdef Node* b
    cdef int64_t joined
    i = 0
    while i < n:
        j = 0
        while j < n:
            a = &builder.nodes[edges[i].node]
            b = &builder.nodes[edges[j].node]
            if (i != j and a.value >= 0 and a.value == b.value
                    and edges[j].row == edges[i].row + a.rows
                and edges[j].col == edges[i].col + a.rows):
                joined = _intern_run(builder, <int64_t>a.rows + b.rows, a.value)
                if joined < 0:
                    return <int>joined
                edges[i].node = <int32_t>joined
                quadrants[i] |= quadrants[j]
                last = n - 1
                edges[j] = edges[last]
                quadrants[j] = quadrants[last]
                n -= 1
                if i == last:
                    i = j
                j = 0
            else:
                j += 1
        i += 1
    return n


cdef bint _precedes(int32_t a, int32_t b) noexcept nogil:
    """Whether an edge over the quadrants `a` must come before one over `b`.

    Quadrants are bits: 1, 2, 4, 8 for 00, 01, 10, 11.
    """
    return (a & 1 and b & 2) or (a & 4 and b & 8)


cdef void _sort_edges(Edge* edges, int32_t* quadrants, int n) noexcept nogil:
    """Order edges so that every row gets its columns in ascending order."""
    cdef int i, j, k
    cdef Edge edge
    cdef int32_t q
    for i in range(n):
        for j in range(i, n):          # the next edge: one that no other must precede
            for k in range(i, n):
                if k != j and _precedes(quadrants[k], quadrants[j]):
                    break
            else:
                break
        edge = edges[j]
        q = quadrants[j]
        edges[j] = edges[i]
        quadrants[j] = quadrants[i]
        edges[i] = edge
        quadrants[i] = q


cdef int _intern_edges(Builder* builder, Edge* edges, int32_t* quadrants, int n,
                       Edge* out) noexcept nogil:
    """The submatrix of these edges, as an edge; returns 0 or a negative status."""
    cdef Node node
    cdef uint32_t row = <uint32_t>-1, col = <uint32_t>-1
    cdef int i
    cdef int64_t node_number
    cdef Node* child
    n = _merge_runs(builder, edges, quadrants, n)
    if n < 0:
        return n
    if n == 0:
        memset(out, 0, sizeof(Edge))
        return 0
    if n == 1:
        out[0] = edges[0]
        return 0
    _sort_edges(edges, quadrants, n)
    memset(&node, 0, sizeof(Node))
    node.value = -1
    for i in range(n):
        row = min(row, edges[i].row)
        col = min(col, edges[i].col)
    for i in range(n):
        child = &builder.nodes[edges[i].node]
        node.edges[i].node = edges[i].node
        node.edges[i].row = edges[i].row - row
        node.edges[i].col = edges[i].col - col
        node.rows = max(node.rows, node.edges[i].row + child.rows)
        node.cols = max(node.cols, node.edges[i].col + child.cols)
        if node.entries > INT64_MAX - child.entries:
            return OVERFLOW
        node.entries += child.entries
        node.runs += child.runs
    node_number = _intern(builder, &node)
    if node_number < 0:
        return <int>node_number
    out.node = <int32_t>node_number
    out.row = row
    out.col = col
    return 0


cdef inline bint _is_zero(const Builder* builder, int32_t m) noexcept nogil:
    """Whether a diagram node is the leaf 0."""
    return m < builder.diagram.leaves and builder.diagram.value[m] == 0


cdef inline int32_t _branch(const Builder* builder, int32_t m, int32_t level,
                            int bit) noexcept nogil:
    """The child of a diagram node for a bit at a level."""
    if m >= builder.diagram.leaves and builder.diagram.level[m] == level:
        return builder.diagram.high[m] if bit else builder.diagram.low[m]
    return m


cdef int _build(Builder* builder, int32_t m, int32_t r, int32_t c, Edge* out) noexcept nogil:
    """The submatrix of a triple, as an edge; returns 0 or a negative status."""
    cdef int32_t depth, a, b, ma, mab, ra, cb
    cdef int n = 0, status
    cdef int64_t node_number
    cdef Edge edges[4]
    cdef int32_t quadrants[4]
    cdef MemoEntry* entry
    cdef uint64_t key
    while True:
        if r == 0 or c == 0 or _is_zero(builder, m):
            memset(out, 0, sizeof(Edge))
            return 0
        depth = builder.row.depth[r]
        if depth == builder.k:
            if m >= builder.diagram.leaves:
                return FOREIGN_LEVEL
            node_number = _intern_run(builder, 1, m)
            out.node = <int32_t>node_number
            out.row = out.col = 0
            return 0 if node_number >= 0 else OUT_OF_MEMORY
        if m >= builder.diagram.leaves and builder.diagram.level[m] < builder.row_levels[depth]:
            return FOREIGN_LEVEL
        # Where both bits are determined, descend: such triples are not memoised.
        if ((builder.row.low[r] and builder.row.high[r])
                or (builder.col.low[c] and builder.col.high[c])):
            break
        a = builder.row.low[r] == 0
        b = builder.col.low[c] == 0
        m = _branch(builder, m, builder.row_levels[depth], a)
        m = _branch(builder, m, builder.col_levels[depth], b)
        r = builder.row.high[r] if a else builder.row.low[r]
        c = builder.col.high[c] if b else builder.col.low[c]
    key = (<uint64_t><uint32_t>m << 32) | <uint32_t>r
    entry = memo_find(&builder.memo, key, <uint32_t>c)
    if not memo_is_empty(entry):
        out.node = entry.node
        out.row = <uint32_t>(<uint64_t>entry.first >> 32)
        out.col = <uint32_t>entry.first
        return 0
    for a in range(2):
        ra = builder.row.high[r] if a else builder.row.low[r]
        ma = _branch(builder, m, builder.row_levels[depth], a)
        if ra == 0 or _is_zero(builder, ma):
            continue
        for b in range(2):
            cb = builder.col.high[c] if b else builder.col.low[c]
            mab = _branch(builder, ma, builder.col_levels[depth], b)
            if cb == 0 or _is_zero(builder, mab):
                continue
            status = _build(builder, mab, ra, cb, &edges[n])
            if status < 0:
                return status
            if edges[n].node:
                if a:
                    edges[n].row += <uint32_t>builder.row.count[builder.row.low[r]]
                if b:
                    edges[n].col += <uint32_t>builder.col.count[builder.col.low[c]]
                quadrants[n] = 1 << (2 * a + b)
                n += 1
    status = _intern_edges(builder, edges, quadrants, n, out)
    if status < 0:
        return status
    entry = memo_insert(&builder.memo, key, <uint32_t>c)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = out.node
    entry.first = <int64_t>((<uint64_t>out.row << 32) | <uint64_t>out.col)
    return 0


cdef class QuadDag:
    """The quad-DAG of matrices with common rows and columns; one root per matrix.

    Args:
        level, low, high: int32[nodes], the diagrams; the nodes below len(values) are leaves.
        values: float64[leaves].
        roots: int32, the diagram node of each matrix.
        row, col: ODDs (depth, low, high, count, root) with as many levels as row_levels and
            col_levels.
        row_levels, col_levels: int32[k], the levels of the bits in the diagrams.
    Raises:
        OverflowError: there are 2**31 rows or columns or more, or 2**63 entries.
        ValueError: a matrix depends on another level.

    rows, columns: size of the matrices. nodes: number of distinct submatrices. triples: number of
    triples visited. entries: int64[roots], number of entries of each matrix.
    """

    def __cinit__(self):
        memset(&self.builder, 0, sizeof(Builder))
        self.roots = NULL

    def __dealloc__(self):
        memo_close(&self.builder.memo)
        free(self.builder.nodes)
        free(self.builder.unique)
        free(self.roots)

    def __init__(self, level: Int32s, low: Int32s, high: Int32s, const double[::1] values,
                 const int32_t[::1] roots, row: OddTable, col: OddTable,
                 const int32_t[::1] row_levels, const int32_t[::1] col_levels):
        cdef int64_t i
        cdef int status = 0
        cdef int64_t[::1] entries
        cdef Builder* builder = &self.builder
        builder.row, builder.col = odd_of(row), odd_of(col)
        self.rows = builder.row.count[builder.row.root]
        self.columns = builder.col.count[builder.col.root]
        if self.rows >= 0x7FFFFFFF or self.columns >= 0x7FFFFFFF:
            size = f"{self.rows} rows and {self.columns} columns"
            raise OverflowError(f"a matrix of {size}: 2**31 is too many")
        if row_levels.shape[0] != col_levels.shape[0]:
            raise ValueError("rows and columns have different numbers of bits")
        builder.diagram = diagram_of((level, low, high, values, 0))
        builder.k = <int32_t>row_levels.shape[0]
        builder.row_levels, builder.col_levels = pointer_of(row_levels), pointer_of(col_levels)
        self.values = np.array(values)
        builder.capacity = builder.unique_size = 4096
        builder.nodes = <Node*>malloc(builder.capacity * sizeof(Node))
        builder.unique = <int32_t*>malloc(builder.unique_size * 4)
        self.roots = <Edge*>malloc((roots.shape[0] + 1) * sizeof(Edge))
        if (builder.nodes == NULL or builder.unique == NULL or self.roots == NULL
                or memo_open(&builder.memo, 4096) < 0):
            raise MemoryError
        memset(builder.unique, 0, builder.unique_size * 4)
        memset(builder.nodes, 0, sizeof(Node))
        builder.node_count = 1
        for i in range(roots.shape[0]):
            with nogil:
                status = _build(builder, roots[i], builder.row.root, builder.col.root,
                                &self.roots[i])
            if status == OUT_OF_MEMORY:
                raise MemoryError("no memory for the quad-DAG")
            if status == OVERFLOW:
                raise OverflowError("the matrix has 2**63 entries or more")
            if status == FOREIGN_LEVEL:
                raise ValueError("a variable of the matrix is neither row nor column bit")
        self.triples = self.builder.memo.count
        memo_close(&self.builder.memo)          # the nodes suffice from here on
        free(self.builder.unique)
        self.builder.unique = NULL
        self.entries = np.empty(roots.shape[0], np.int64)
        entries = self.entries
        for i in range(roots.shape[0]):
            entries[i] = self.builder.nodes[self.roots[i].node].entries

    @property
    def nodes(self) -> int:
        """Number of distinct submatrices."""
        return self.builder.node_count - 1
