# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The quad-DAG: the distinct sub-matrices of a matrix diagram.

A matrix is an MTBDD over interleaved row and column bits (row bit i above column bit i above row
bit i+1); its rows are the members of a row ODD, its columns those of a column ODD (see `odd.pyx`),
over the same number k of bits. The triple (diagram node, row node, column node) determines a
sub-matrix. Triples are walked once each; sub-matrices are stored once each: a node is either a
*run* (a constant along `length` diagonal cells) or up to four edges (node, row, column), and two
sub-matrices that differ only by where they stand are one node.
`symcheck.kernels.blocks.block_matrix` cuts it into blocks.
"""
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcmp, memset

from symcheck.kernels.tables.memo_table cimport (MemoEntry, memo_close, memo_find, memo_is_empty,
                                                 memo_insert, memo_open)

import numpy as np

__all__ = ["Quad"]

cdef enum:
    OUT_OF_MEMORY = -1
    OVERFLOW = -2
    FOREIGN_LEVEL = -3


cdef uint64_t _content_hash(const Node* node) noexcept nogil:
    cdef uint64_t h = <uint64_t>(node.value
                                 + 1) * <uint64_t>0x9E3779B97F4A7C15 + <uint64_t>node.rows
    cdef int i
    for i in range(4):
        h ^= (<uint64_t><uint32_t>node.edges[i].node << 32) ^ <uint64_t>node.edges[i].row ^ (<uint64_t>node.edges[i].col << 17)
        h *= <uint64_t>0xD6E8FEB86659FD93
        h ^= h >> 32
    return h


cdef bint _same(const Node* a, const Node* b) noexcept nogil:
    return (a.value == b.value and a.rows == b.rows
            and memcmp(a.edges, b.edges, sizeof(a.edges)) == 0)


cdef int _grow_unique(Walk* w) noexcept nogil:
    cdef int64_t size = 2 * w.unique_size, i
    cdef uint64_t at
    free(w.unique)
    w.unique = <int32_t*>malloc(size * 4)
    if w.unique == NULL:
        return OUT_OF_MEMORY
    memset(w.unique, 0, size * 4)
    w.unique_size = size
    for i in range(1, w.used):
        at = _content_hash(&w.nodes[i]) & (size - 1)
        while w.unique[at]:
            at = (at + 1) & (size - 1)
        w.unique[at] = <int32_t>i
    return 0


cdef int64_t _intern(Walk* w, Node* node) noexcept nogil:
    """The number of the node with this content, or a negative status."""
    cdef uint64_t at
    if 2 * w.used >= w.unique_size:
        if _grow_unique(w) < 0:
            return OUT_OF_MEMORY
    at = _content_hash(node) & (w.unique_size - 1)
    while w.unique[at]:
        if _same(&w.nodes[w.unique[at]], node):
            return w.unique[at]
        at = (at + 1) & (w.unique_size - 1)
    if w.used == w.room:
        if w.room > 0x3FFFFFFF:
            return OUT_OF_MEMORY
        w.room *= 2
        w.nodes = <Node*>realloc(w.nodes, w.room * sizeof(Node))
        if w.nodes == NULL:
            return OUT_OF_MEMORY
    w.nodes[w.used] = node[0]
    w.unique[at] = <int32_t>w.used
    w.used += 1
    return w.used - 1


cdef int64_t _run(Walk* w, int64_t length, int32_t value) noexcept nogil:
    cdef Node node
    memset(&node, 0, sizeof(Node))
    node.entries = length
    node.runs = 1
    node.rows = node.cols = <uint32_t>length
    node.value = value
    return _intern(w, &node)


cdef int _merge_runs(Walk* w, Edge* edges, int32_t* quadrants, int n) noexcept nogil:
    """Join runs that continue each other along the diagonal. Returns how many edges are left, or a
    negative status.
    """
    cdef int i, j, last
    cdef Node* a
    cdef Node* b
    cdef int64_t joined
    i = 0
    while i < n:
        j = 0
        while j < n:
            a = &w.nodes[edges[i].node]
            b = &w.nodes[edges[j].node]
            if (i != j and a.value >= 0 and a.value == b.value
                    and edges[j].row == edges[i].row + a.rows
                and edges[j].col == edges[i].col + a.rows):
                joined = _run(w, <int64_t>a.rows + b.rows, a.value)
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
    """Must an edge that covers the quadrants `a` come before one with `b`? (bits 1, 2, 4, 8: 00,
    01, 10, 11)
    """
    return (a & 1 and b & 2) or (a & 4 and b & 8)


cdef void _order(Edge* edges, int32_t* quadrants, int n) noexcept nogil:
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


cdef int _combine(Walk* w, Edge* edges, int32_t* quadrants, int n, Edge* out) noexcept nogil:
    cdef Node node
    cdef uint32_t row = <uint32_t>-1, col = <uint32_t>-1
    cdef int i
    cdef int64_t number
    cdef Node* child
    n = _merge_runs(w, edges, quadrants, n)
    if n < 0:
        return n
    if n == 0:
        memset(out, 0, sizeof(Edge))
        return 0
    if n == 1:
        out[0] = edges[0]
        return 0
    _order(edges, quadrants, n)
    memset(&node, 0, sizeof(Node))
    node.value = -1
    for i in range(n):
        row = min(row, edges[i].row)
        col = min(col, edges[i].col)
    for i in range(n):
        child = &w.nodes[edges[i].node]
        node.edges[i].node = edges[i].node
        node.edges[i].row = edges[i].row - row
        node.edges[i].col = edges[i].col - col
        node.rows = max(node.rows, node.edges[i].row + child.rows)
        node.cols = max(node.cols, node.edges[i].col + child.cols)
        if node.entries > INT64_MAX - child.entries:
            return OVERFLOW
        node.entries += child.entries
        node.runs += child.runs
    number = _intern(w, &node)
    if number < 0:
        return <int>number
    out.node = <int32_t>number
    out.row = row
    out.col = col
    return 0


cdef inline bint _zero(const Walk* w, int32_t m) noexcept nogil:
    return m < w.leaves and w.values[m] == 0


cdef inline int32_t _branch(const Walk* w, int32_t m, int32_t level, int bit) noexcept nogil:
    if m >= w.leaves and w.level[m] == level:
        return w.high[m] if bit else w.low[m]
    return m


cdef int _walk(Walk* w, int32_t m, int32_t r, int32_t c, Edge* out) noexcept nogil:
    """The sub-matrix of a triple, as an edge."""
    cdef int32_t depth, a, b, ma, mab, ra, cb
    cdef int n = 0, status
    cdef int64_t number
    cdef Edge edges[4]
    cdef int32_t quadrants[4]
    cdef MemoEntry* entry
    cdef uint64_t key
    while True:
        if r == 0 or c == 0 or _zero(w, m):
            memset(out, 0, sizeof(Edge))
            return 0
        depth = w.row.depth[r]
        if depth == w.k:
            if m >= w.leaves:
                return FOREIGN_LEVEL
            number = _run(w, 1, m)
            out.node = <int32_t>number
            out.row = out.col = 0
            return 0 if number >= 0 else OUT_OF_MEMORY
        if m >= w.leaves and w.level[m] < w.row_levels[depth]:
            return FOREIGN_LEVEL
        # where the bits are forced, step on: such triples need no memory
        if w.row.low[r] == 0 and w.col.low[c] == 0:
            m = _branch(w, _branch(w, m, w.row_levels[depth], 1), w.col_levels[depth], 1)
            r = w.row.high[r]
            c = w.col.high[c]
        elif w.row.low[r] == 0 and w.col.high[c] == 0:
            m = _branch(w, _branch(w, m, w.row_levels[depth], 1), w.col_levels[depth], 0)
            r = w.row.high[r]
            c = w.col.low[c]
        elif w.row.high[r] == 0 and w.col.low[c] == 0:
            m = _branch(w, _branch(w, m, w.row_levels[depth], 0), w.col_levels[depth], 1)
            r = w.row.low[r]
            c = w.col.high[c]
        elif w.row.high[r] == 0 and w.col.high[c] == 0:
            m = _branch(w, _branch(w, m, w.row_levels[depth], 0), w.col_levels[depth], 0)
            r = w.row.low[r]
            c = w.col.low[c]
        else:
            break
    key = (<uint64_t><uint32_t>m << 32) | <uint32_t>r
    entry = memo_find(&w.memo, key, <uint32_t>c)
    if not memo_is_empty(entry):
        out.node = entry.node
        out.row = <uint32_t>(<uint64_t>entry.first >> 32)
        out.col = <uint32_t>entry.first
        return 0
    for a in range(2):
        ra = w.row.high[r] if a else w.row.low[r]
        ma = _branch(w, m, w.row_levels[depth], a)
        if ra == 0 or _zero(w, ma):
            continue
        for b in range(2):
            cb = w.col.high[c] if b else w.col.low[c]
            mab = _branch(w, ma, w.col_levels[depth], b)
            if cb == 0 or _zero(w, mab):
                continue
            status = _walk(w, mab, ra, cb, &edges[n])
            if status < 0:
                return status
            if edges[n].node:
                if a:
                    edges[n].row += <uint32_t>w.row.count[w.row.low[r]]
                if b:
                    edges[n].col += <uint32_t>w.col.count[w.col.low[c]]
                quadrants[n] = 1 << (2 * a + b)
                n += 1
    status = _combine(w, edges, quadrants, n, out)
    if status < 0:
        return status
    entry = memo_insert(&w.memo, key, <uint32_t>c)
    if entry == NULL:
        return OUT_OF_MEMORY
    entry.node = out.node
    entry.first = <int64_t>((<uint64_t>out.row << 32) | <uint64_t>out.col)
    return 0


cdef class Quad:
    """The quad-DAG of matrices with common rows and columns; one root per matrix.

    rows, columns, nodes, triples: sizes. entries: int64[roots].
    """

    def __cinit__(self):
        memset(&self.w, 0, sizeof(Walk))
        self.roots = NULL

    def __dealloc__(self):
        memo_close(&self.w.memo)
        free(self.w.nodes)
        free(self.w.unique)
        free(self.roots)

    def __init__(self, const int32_t[::1] level, const int32_t[::1] low, const int32_t[::1] high,
                 const double[::1] values, const int32_t[::1] roots, row, col,
                 const int32_t[::1] row_levels, const int32_t[::1] col_levels):
        """level, low, high: int32 per diagram node, where the nodes below len(values) are leaves
        with these values.

        row, col: ODDs (depth, low, high, count, root) with as many levels as row_levels and
        col_levels. Raises OverflowError for 2**31 rows or columns or more, ValueError where a
        diagram reads another level.
        """
        cdef const int32_t[::1] rd = row[0], rl = row[1], rh = row[2], cd = col[0], cl = col[1]
        cdef const int32_t[::1] ch = col[2]
        cdef const int64_t[::1] rc = row[3], cc = col[3]
        cdef int32_t rroot = row[4], croot = col[4], dummy = 0
        cdef int64_t i
        cdef int status = 0
        cdef int64_t[::1] entries
        self.rows = rc[rroot]
        self.columns = cc[croot]
        if self.rows >= 0x7FFFFFFF or self.columns >= 0x7FFFFFFF:
            raise OverflowError(f"a matrix of {self.rows} rows and {self.columns} columns: 2**31 is too many")
        if row_levels.shape[0] != col_levels.shape[0]:
            raise ValueError("rows and columns have different numbers of bits")
        self.w.level, self.w.low, self.w.high = &level[0], &low[0], &high[0]
        self.w.values, self.w.leaves = &values[0], <int32_t>values.shape[0]
        self.w.k = <int32_t>row_levels.shape[0]
        self.w.row_levels = &row_levels[0] if self.w.k else &dummy
        self.w.col_levels = &col_levels[0] if self.w.k else &dummy
        self.w.row = Odd(&rd[0], &rl[0], &rh[0], &rc[0])
        self.w.col = Odd(&cd[0], &cl[0], &ch[0], &cc[0])
        self.table_values = np.array(values)
        self.w.room = self.w.unique_size = 4096
        self.w.nodes = <Node*>malloc(self.w.room * sizeof(Node))
        self.w.unique = <int32_t*>malloc(self.w.unique_size * 4)
        self.roots = <Edge*>malloc((roots.shape[0] + 1) * sizeof(Edge))
        if (self.w.nodes == NULL or self.w.unique == NULL or self.roots == NULL
                or memo_open(&self.w.memo, 4096) < 0):
            raise MemoryError
        memset(self.w.unique, 0, self.w.unique_size * 4)
        memset(self.w.nodes, 0, sizeof(Node))
        self.w.used = 1
        for i in range(roots.shape[0]):
            with nogil:
                status = _walk(&self.w, roots[i], rroot, croot, &self.roots[i])
            if status == OUT_OF_MEMORY:
                raise MemoryError("no memory for the quad-DAG")
            if status == OVERFLOW:
                raise OverflowError("the matrix has 2**63 entries or more")
            if status == FOREIGN_LEVEL:
                raise ValueError("the matrix depends on a variable that is neither a row nor a column bit")
        self.triples = self.w.memo.count
        memo_close(&self.w.memo)          # what follows needs the nodes only
        free(self.w.unique)
        self.w.unique = NULL
        self.entries = np.empty(roots.shape[0], np.int64)
        entries = self.entries
        for i in range(roots.shape[0]):
            entries[i] = self.w.nodes[self.roots[i].node].entries

    @property
    def nodes(self):
        """Number of distinct sub-matrices."""
        return self.w.used - 1
