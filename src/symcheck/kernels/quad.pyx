# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""From a matrix diagram to rows of numbers: the quad-DAG, and blocks of diagonal runs cut from it.

A matrix is an MTBDD over interleaved row and column bits (row bit i above column bit i above row bit i+1); its rows are
the members of a row ODD, its columns those of a column ODD (see `odd.pyx`), over the same number k of bits. The triple
(diagram node, row node, column node) determines a sub-matrix. Triples are walked once each; sub-matrices are stored once
each: a node is either a *run* (a constant along `length` diagonal cells) or up to four edges (node, row, column), and
two sub-matrices that differ only by where they stand are one node.

Cutting the DAG where the distinct sub-matrices are few gives *blocks*: lists of runs, stored once, with the places
where they stand. A product with a vector, or the compressed rows, come from stamping the blocks at their places.
A run of one value along a diagonal is what unchanged variables look like, so most runs are long; in the worst case
a run is one entry.
"""
from libc.stdint cimport INT64_MAX, int32_t, int64_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcmp, memcpy, memset

from symcheck.kernels._memo cimport Memo, Slot, memo_close, memo_find, memo_free, memo_insert, memo_open

import numpy as np

__all__ = ["Blocks", "Quad"]

cdef enum:
    OUT_OF_MEMORY = -1
    OVERFLOW = -2
    FOREIGN_LEVEL = -3

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__GLIBC__)
    /* no clone with fused multiply-add: the digits shall not depend on the machine */
    #define SYMCHECK_CLONES __attribute__((target_clones("avx2", "default")))
    #else
    #define SYMCHECK_CLONES
    #endif

    typedef struct { uint16_t row, col, length, value; } SmallRun;
    typedef struct { uint32_t row, col, length, value; } WideRun;

    #define SYMCHECK_MULTIPLY(NAME, RUN)                                                                          \
    SYMCHECK_CLONES static void NAME(const RUN* run, int64_t runs, const double* values,                          \
                                     const double* __restrict__ x, double* __restrict__ y) {                      \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            const double* __restrict__ from = x + run[i].col;                                                     \
            double* __restrict__ to = y + run[i].row;                                                             \
            const int64_t n = run[i].length;                                                                      \
            if (n == 1) { to[0] += v * from[0]; continue; }                                                       \
            for (int64_t j = 0; j < n; j++) to[j] += v * from[j];                                                 \
        }                                                                                                         \
    }
    SYMCHECK_MULTIPLY(multiply_small, SmallRun)
    SYMCHECK_MULTIPLY(multiply_wide, WideRun)

    #define SYMCHECK_TRANSPOSED(NAME, RUN)                                                                        \
    SYMCHECK_CLONES static void NAME(const RUN* run, int64_t runs, const double* values,                          \
                                     const double* __restrict__ x, double* __restrict__ y) {                      \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            const double* __restrict__ from = x + run[i].row;                                                     \
            double* __restrict__ to = y + run[i].col;                                                             \
            const int64_t n = run[i].length;                                                                      \
            for (int64_t j = 0; j < n; j++) to[j] += v * from[j];                                                 \
        }                                                                                                         \
    }
    SYMCHECK_TRANSPOSED(transposed_small, SmallRun)
    SYMCHECK_TRANSPOSED(transposed_wide, WideRun)

    /* only rows low .. high (relative to the block) */
    #define SYMCHECK_CLIPPED(NAME, RUN)                                                                           \
    static void NAME(const RUN* run, int64_t runs, const double* values, const double* x, double* y,              \
                     int64_t low, int64_t high) {                                                                 \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            const int64_t row = run[i].row, shift = (int64_t)run[i].col - row;                                    \
            int64_t end = row + run[i].length;                                                                    \
            if (end > high) end = high;                                                                           \
            for (int64_t j = row > low ? row : low; j < end; j++) y[j] += v * x[j + shift];                       \
        }                                                                                                         \
    }
    SYMCHECK_CLIPPED(clipped_small, SmallRun)
    SYMCHECK_CLIPPED(clipped_wide, WideRun)

    #define SYMCHECK_COUNT(NAME, RUN)                                                                             \
    static void NAME(const RUN* run, int64_t runs, int32_t* counts) {                                             \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            int32_t* to = counts + run[i].row;                                                                    \
            for (int64_t j = 0; j < run[i].length; j++) to[j]++;                                                  \
        }                                                                                                         \
    }
    SYMCHECK_COUNT(count_small, SmallRun)
    SYMCHECK_COUNT(count_wide, WideRun)

    #define SYMCHECK_FILL(NAME, RUN)                                                                              \
    static void NAME(const RUN* run, int64_t runs, const double* values, int64_t* next, int64_t column,           \
                     int32_t* __restrict__ indices, double* __restrict__ data) {                                  \
        for (int64_t i = 0; i < runs; i++) {                                                                      \
            const double v = values[run[i].value];                                                                \
            int64_t* at = next + run[i].row;                                                                      \
            const int32_t c = (int32_t)(column + run[i].col);                                                     \
            for (int64_t j = 0; j < run[i].length; j++) {                                                         \
                const int64_t p = at[j]++;                                                                        \
                indices[p] = c + (int32_t)j;                                                                      \
                data[p] = v;                                                                                      \
            }                                                                                                     \
        }                                                                                                         \
    }
    SYMCHECK_FILL(fill_small, SmallRun)
    SYMCHECK_FILL(fill_wide, WideRun)
    """
    ctypedef struct SmallRun:
        uint16_t row, col, length, value
    ctypedef struct WideRun:
        uint32_t row, col, length, value
    void multiply_small(const SmallRun* run, int64_t runs, const double* values, const double* x, double* y) noexcept nogil
    void multiply_wide(const WideRun* run, int64_t runs, const double* values, const double* x, double* y) noexcept nogil
    void transposed_small(const SmallRun* run, int64_t runs, const double* values, const double* x, double* y) noexcept nogil
    void transposed_wide(const WideRun* run, int64_t runs, const double* values, const double* x, double* y) noexcept nogil
    void clipped_small(const SmallRun* run, int64_t runs, const double* values, const double* x, double* y,
                       int64_t low, int64_t high) noexcept nogil
    void clipped_wide(const WideRun* run, int64_t runs, const double* values, const double* x, double* y,
                      int64_t low, int64_t high) noexcept nogil
    void count_small(const SmallRun* run, int64_t runs, int32_t* counts) noexcept nogil
    void count_wide(const WideRun* run, int64_t runs, int32_t* counts) noexcept nogil
    void fill_small(const SmallRun* run, int64_t runs, const double* values, int64_t* next, int64_t column,
                    int32_t* indices, double* data) noexcept nogil
    void fill_wide(const WideRun* run, int64_t runs, const double* values, int64_t* next, int64_t column,
                   int32_t* indices, double* data) noexcept nogil

# ---------------------------------------------------------------------------------------------- the DAG

cdef struct Edge:
    int32_t node          # 0: no entries
    uint32_t row
    uint32_t col

cdef struct Node:
    Edge edges[4]         # in an order that gives each row its columns in ascending order; a run has none
    int64_t entries
    int64_t runs          # runs below, counted with repetition: the size when flattened
    uint32_t rows         # extent: 1 + the last row, 1 + the last column; the first row and column are 0
    uint32_t cols
    int32_t value         # of a run; -1 otherwise

cdef struct Odd:
    const int32_t* depth
    const int32_t* low
    const int32_t* high
    const int64_t* count

cdef struct Walk:
    const int32_t* level
    const int32_t* low
    const int32_t* high
    const double* values  # of the leaves, which are the nodes below `leaves`
    int32_t leaves
    const int32_t* row_levels
    const int32_t* col_levels
    int32_t k
    Odd row
    Odd col
    Memo memo             # triple -> node, place
    Node* nodes
    int64_t used
    int64_t room
    int32_t* unique       # open addressing over nodes, by content; 0 is free
    int64_t unique_size


cdef uint64_t _content_hash(const Node* node) noexcept nogil:
    cdef uint64_t h = <uint64_t>(node.value + 1) * <uint64_t>0x9E3779B97F4A7C15 + <uint64_t>node.rows
    cdef int i
    for i in range(4):
        h ^= (<uint64_t><uint32_t>node.edges[i].node << 32) ^ <uint64_t>node.edges[i].row ^ (<uint64_t>node.edges[i].col << 17)
        h *= <uint64_t>0xD6E8FEB86659FD93
        h ^= h >> 32
    return h


cdef bint _same(const Node* a, const Node* b) noexcept nogil:
    return a.value == b.value and a.rows == b.rows and memcmp(a.edges, b.edges, sizeof(a.edges)) == 0


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
    """Join runs that continue each other along the diagonal. Returns how many edges are left, or a negative status."""
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
            if (i != j and a.value >= 0 and a.value == b.value and edges[j].row == edges[i].row + a.rows
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
    """Must an edge that covers the quadrants `a` come before one with `b`? (bits 1, 2, 4, 8: 00, 01, 10, 11)"""
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
    cdef Slot* slot
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
    slot = memo_find(&w.memo, key, <uint32_t>c)
    if not memo_free(slot):
        out.node = slot.node
        out.row = <uint32_t>(<uint64_t>slot.a >> 32)
        out.col = <uint32_t>slot.a
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
    slot = memo_insert(&w.memo, key, <uint32_t>c)
    if slot == NULL:
        return OUT_OF_MEMORY
    slot.node = out.node
    slot.a = <int64_t>((<uint64_t>out.row << 32) | <uint64_t>out.col)
    return 0


cdef class Quad:
    """The quad-DAG of matrices with common rows and columns; one root per matrix.

    rows, columns, nodes, triples: sizes. entries: int64[roots]. `cut` gives the blocks.
    """

    cdef Walk w
    cdef Edge* roots
    cdef object table_values
    cdef readonly int64_t rows, columns, triples
    cdef readonly object entries

    def __cinit__(self):
        memset(&self.w, 0, sizeof(Walk))
        self.roots = NULL

    def __dealloc__(self):
        memo_close(&self.w.memo)
        free(self.w.nodes)
        free(self.w.unique)
        free(self.roots)

    def __init__(self, const int32_t[::1] level, const int32_t[::1] low, const int32_t[::1] high,
                 const double[::1] values, const int32_t[::1] roots, row, col, const int32_t[::1] row_levels, const int32_t[::1] col_levels):
        """level, low, high: int32 per diagram node, where the nodes below len(values) are leaves with these values.

        row, col: ODDs (depth, low, high, count, root) with as many levels as row_levels and col_levels.
        Raises OverflowError for 2**31 rows or columns or more, ValueError where a diagram reads another level.
        """
        cdef const int32_t[::1] rd = row[0], rl = row[1], rh = row[2], cd = col[0], cl = col[1], ch = col[2]
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
        if self.w.nodes == NULL or self.w.unique == NULL or self.roots == NULL or memo_open(&self.w.memo, 4096) < 0:
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
        self.triples = self.w.memo.used
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

    def cut(self, int64_t budget):
        """Blocks with at most about `budget` runs in all, as few places as that allows."""
        return Blocks(self, budget)

# ---------------------------------------------------------------------------------------------- blocks

cdef struct Block:
    int64_t start         # first run, in the array of its kind
    int64_t runs
    uint32_t rows
    uint32_t cols
    bint wide

cdef struct Place:
    int32_t block
    uint32_t row
    uint32_t col

cdef struct Cell:         # a run while its block is made: `key` sorts by diagonal, then row
    uint64_t key
    uint32_t length
    uint32_t value


cdef void _sort(Cell* cells, Cell* spare, int64_t n) noexcept nogil:
    """By key, ascending: insertion for few, otherwise by bytes, leaving out those that are alike in all keys."""
    cdef int64_t i, j, counts[256], total, c
    cdef Cell cell
    cdef uint64_t every = 0, first
    cdef int shift
    cdef Cell* source = cells
    cdef Cell* target = spare
    if n <= 32:
        for i in range(1, n):
            cell = cells[i]
            j = i
            while j > 0 and cells[j - 1].key > cell.key:
                cells[j] = cells[j - 1]
                j -= 1
            cells[j] = cell
        return
    first = cells[0].key
    for i in range(n):
        every |= cells[i].key ^ first
    for shift in range(0, 64, 8):
        if (every >> shift) & 255 == 0:
            continue
        memset(counts, 0, sizeof(counts))
        for i in range(n):
            counts[(source[i].key >> shift) & 255] += 1
        total = 0
        for i in range(256):
            c = counts[i]
            counts[i] = total
            total += c
        for i in range(n):
            c = (source[i].key >> shift) & 255
            target[counts[c]] = source[i]
            counts[c] += 1
        source, target = target, source
    if source != cells:
        memcpy(cells, source, n * sizeof(Cell))


cdef void _cells(const Node* nodes, int32_t number, uint32_t row, uint32_t col, Cell* cells, int64_t* used) noexcept nogil:
    cdef const Node* node = &nodes[number]
    cdef int i
    cdef Cell* cell
    if node.value >= 0:
        cell = &cells[used[0]]
        cell.key = ((<uint64_t>col + ((<uint64_t>1) << 31) - row) << 32) | row
        cell.length = node.rows
        cell.value = <uint32_t>node.value
        used[0] += 1
        return
    for i in range(4):
        if node.edges[i].node == 0:
            return
        _cells(nodes, node.edges[i].node, row + node.edges[i].row, col + node.edges[i].col, cells, used)


cdef int64_t _join(Cell* cells, int64_t n) noexcept nogil:
    """Join runs that continue each other; returns how many are left."""
    cdef int64_t i, last = 0
    for i in range(1, n):
        if cells[i].value == cells[last].value and cells[i].key == cells[last].key + cells[last].length:
            cells[last].length += cells[i].length
        else:
            last += 1
            cells[last] = cells[i]
    return last + 1 if n else 0


cdef class Blocks:
    """Distinct blocks of runs, and for each root the places where they stand, parted by rows.

    Products add to their output. Rows and columns are checked against the lengths of the arrays.
    """

    cdef Block* blocks
    cdef SmallRun* small
    cdef WideRun* wide
    cdef Place* places
    cdef int64_t small_used, wide_used, blocks_used, places_used
    cdef int64_t[::1] starts           # of each root's places
    cdef const double[::1] values
    cdef readonly int64_t rows, columns, roots
    cdef readonly object entries
    cdef readonly int64_t threshold

    def __cinit__(self):
        self.blocks = NULL
        self.small = NULL
        self.wide = NULL
        self.places = NULL

    def __dealloc__(self):
        free(self.blocks)
        free(self.small)
        free(self.wide)
        free(self.places)

    def __init__(self, Quad quad, int64_t budget):
        cdef int64_t i, threshold
        cdef int32_t* block_of
        self.rows, self.columns = quad.rows, quad.columns
        self.roots = len(quad.entries)
        self.entries = quad.entries
        self.values = quad.table_values
        self.starts = np.zeros(self.roots + 1, np.int64)
        block_of = <int32_t*>malloc(quad.w.used * 4)
        if block_of == NULL:
            raise MemoryError
        try:
            self.threshold = self._choose(quad, budget, block_of)
            self._compile(quad, block_of)
            self._stand(quad, block_of)
        finally:
            free(block_of)

    cdef int64_t _choose(self, Quad quad, int64_t budget, int32_t* block_of) except -1:
        """The largest threshold at which the distinct blocks are within the budget and the memory near its minimum.

        On return block_of[node] is -1 for a node above the cut, -3 for a block and -2 for what is not reached.
        """
        cdef int64_t largest = 1, threshold, best = 1, i
        cdef double size, best_size = -1, runs, places
        for i in range(self.roots):
            largest = max(largest, quad.w.nodes[quad.roots[i].node].runs)
        sizes = []
        threshold = largest
        while True:
            runs, places = self._measure(quad, threshold, block_of)
            sizes.append((threshold, runs, 8 * runs + sizeof(Place) * places))
            if runs <= budget or threshold <= 1:
                break
            threshold = threshold * 2 // 3
        least = min(s for _, _, s in sizes)
        best = next(t for t, r, s in sizes if s <= max(8.0 * budget, 1.25 * least))
        self._measure(quad, best, block_of)
        return best

    cdef tuple _measure(self, Quad quad, int64_t threshold, int32_t* block_of):
        """(runs in distinct blocks, number of places) when nodes of at most `threshold` runs are blocks."""
        cdef int64_t i, n = quad.w.used
        cdef double runs = 0, places = 0
        cdef int32_t child
        cdef int e
        cdef Node* node
        cdef double* paths = <double*>malloc(n * 8)
        if paths == NULL:
            raise MemoryError
        memset(paths, 0, n * 8)
        for i in range(self.roots):
            paths[quad.roots[i].node] += 1
        with nogil:
            block_of[0] = -2
            for i in range(n - 1, 0, -1):     # parents have larger numbers than their children
                node = &quad.w.nodes[i]
                if paths[i] == 0:
                    block_of[i] = -2
                elif node.runs <= threshold:
                    block_of[i] = -3
                    runs += <double>node.runs
                    places += paths[i]
                else:
                    block_of[i] = -1
                    for e in range(4):
                        paths[node.edges[e].node] += paths[i]
        free(paths)
        self.places_used = <int64_t>places if places < 1e15 else <int64_t>1e15
        return runs, places

    cdef int _compile(self, Quad quad, int32_t* block_of) except -1:
        """Flatten each block to runs, sorted by diagonal (so that a row's entries come by ascending column)."""
        cdef int64_t i, j, n = quad.w.used, runs = 0, count = 0, largest = 0, used, small_runs = 0, wide_runs = 0
        cdef Cell* cells = NULL
        cdef Node* node
        cdef Block* block
        cdef bint many = self.values.shape[0] > 65535
        for i in range(1, n):
            if block_of[i] == -3:
                count += 1
                node = &quad.w.nodes[i]
                largest = max(largest, node.runs)
                if many or node.rows > 65535 or node.cols > 65535:
                    wide_runs += node.runs
                else:
                    small_runs += node.runs
        self.blocks = <Block*>malloc((count + 1) * sizeof(Block))
        self.small = <SmallRun*>malloc((small_runs + 1) * sizeof(SmallRun))
        self.wide = <WideRun*>malloc((wide_runs + 1) * sizeof(WideRun))
        cells = <Cell*>malloc((2 * largest + 2) * sizeof(Cell))
        if self.blocks == NULL or self.small == NULL or self.wide == NULL or cells == NULL:
            free(cells)
            raise MemoryError
        with nogil:
            for i in range(1, n):
                if block_of[i] != -3:
                    continue
                node = &quad.w.nodes[i]
                used = 0
                _cells(quad.w.nodes, <int32_t>i, 0, 0, cells, &used)
                _sort(cells, cells + largest + 1, used)
                used = _join(cells, used)
                block_of[i] = <int32_t>self.blocks_used
                block = &self.blocks[self.blocks_used]
                self.blocks_used += 1
                block.rows, block.cols, block.runs = node.rows, node.cols, used
                block.wide = many or node.rows > 65535 or node.cols > 65535
                block.start = self.wide_used if block.wide else self.small_used
                self._store(block, cells)
        free(cells)
        self.small = <SmallRun*>realloc(self.small, (self.small_used + 1) * sizeof(SmallRun))
        self.wide = <WideRun*>realloc(self.wide, (self.wide_used + 1) * sizeof(WideRun))
        return 0

    cdef void _store(self, Block* block, const Cell* cells) noexcept nogil:
        cdef int64_t j
        cdef uint32_t row, col
        cdef WideRun* wide = self.wide + block.start
        cdef SmallRun* small = self.small + block.start
        for j in range(block.runs):
            row = <uint32_t>cells[j].key
            col = <uint32_t>((cells[j].key >> 32) + row - ((<uint64_t>1) << 31))
            if block.wide:
                wide[j].row, wide[j].col, wide[j].length, wide[j].value = row, col, cells[j].length, cells[j].value
            else:
                small[j].row, small[j].col = <uint16_t>row, <uint16_t>col
                small[j].length, small[j].value = <uint16_t>cells[j].length, <uint16_t>cells[j].value
        if block.wide:
            self.wide_used += block.runs
        else:
            self.small_used += block.runs

    cdef int _stand(self, Quad quad, const int32_t* block_of) except -1:
        """List the places of the blocks, root by root, in an order that gives each row ascending columns."""
        cdef int64_t i, room = self.places_used
        if room >= <int64_t>1e15:
            raise MemoryError("the matrix has too many blocks")
        self.places = <Place*>malloc((room + 1) * sizeof(Place))
        if self.places == NULL:
            raise MemoryError(f"no memory for {room} block places")
        self.places_used = 0
        for i in range(self.roots):
            with nogil:
                self._stand_at(quad.w.nodes, block_of, quad.roots[i].node, quad.roots[i].row, quad.roots[i].col)
            self.starts[i + 1] = self.places_used
        return 0

    cdef void _stand_at(self, const Node* nodes, const int32_t* block_of, int32_t number, uint32_t row, uint32_t col) noexcept nogil:
        cdef int e
        cdef const Node* node = &nodes[number]
        if number == 0:
            return
        if block_of[number] >= 0:
            self.places[self.places_used].block = block_of[number]
            self.places[self.places_used].row = row
            self.places[self.places_used].col = col
            self.places_used += 1
            return
        for e in range(4):
            if node.edges[e].node == 0:
                return
            self._stand_at(nodes, block_of, node.edges[e].node, row + node.edges[e].row, col + node.edges[e].col)

    @property
    def nbytes(self):
        """Memory of the runs, blocks, places and values, in bytes."""
        return (self.small_used * sizeof(SmallRun) + self.wide_used * sizeof(WideRun) + self.blocks_used * sizeof(Block)
                + self.places_used * sizeof(Place) + self.values.shape[0] * 8)

    @property
    def statistics(self):
        """Sizes: distinct blocks, their runs (short and wide form), places, entries."""
        return {"blocks": self.blocks_used, "runs": self.small_used + self.wide_used, "wide_runs": self.wide_used,
                "places": self.places_used, "entries": int(self.entries.sum()), "threshold": self.threshold}

    def multiply(self, int root, const double[::1] x, double[::1] y):
        """y += A x for the matrix of a root: x float64[columns], y float64[rows]."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, y.shape[0], x.shape[0])
        if y.shape[0] == 0 or x.shape[0] == 0:
            return
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    multiply_wide(self.wide + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row)
                else:
                    multiply_small(self.small + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row)

    def multiply_rows(self, int root, const double[::1] x, double[::1] y, int64_t low, int64_t high):
        """The same, for rows low .. high only: calls for disjoint rows may run at once."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, y.shape[0], x.shape[0])
        if y.shape[0] == 0 or x.shape[0] == 0:
            return
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if place.row >= high or place.row + block.rows <= low:
                    continue
                if place.row >= low and place.row + block.rows <= high:
                    if block.wide:
                        multiply_wide(self.wide + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row)
                    else:
                        multiply_small(self.small + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row)
                elif block.wide:
                    clipped_wide(self.wide + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row,
                                 low - <int64_t>place.row, high - <int64_t>place.row)
                else:
                    clipped_small(self.small + block.start, block.runs, &self.values[0], &x[0] + place.col, &y[0] + place.row,
                                  low - <int64_t>place.row, high - <int64_t>place.row)

    def multiply_transposed(self, int root, const double[::1] x, double[::1] y):
        """y += x A: x float64[rows], y float64[columns]."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, x.shape[0], y.shape[0])
        if y.shape[0] == 0 or x.shape[0] == 0:
            return
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    transposed_wide(self.wide + block.start, block.runs, &self.values[0], &x[0] + place.row, &y[0] + place.col)
                else:
                    transposed_small(self.small + block.start, block.runs, &self.values[0], &x[0] + place.row, &y[0] + place.col)

    def diagonal(self, int root, double[::1] out):
        """out[i] += A[i, i]. out: float64[min(rows, columns)]."""
        cdef int64_t i, j, shift, row
        cdef uint64_t n = out.shape[0]
        cdef Place* place
        cdef Block* block
        cdef SmallRun* s
        cdef WideRun* w
        self._check(root, self.rows, self.columns)
        if out.shape[0] != min(self.rows, self.columns):
            raise ValueError("the diagonal has another length")
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                shift = <int64_t>place.row - <int64_t>place.col      # a run is on the diagonal where col - row = shift
                if shift > <int64_t>block.cols or -shift > <int64_t>block.rows:
                    continue
                for j in range(block.runs):
                    if block.wide:
                        w = self.wide + block.start + j
                        if <int64_t>w.col - <int64_t>w.row == shift:
                            for row in range(w.row, <int64_t>w.row + w.length):
                                out[place.row + row] += self.values[w.value]
                    else:
                        s = self.small + block.start + j
                        if <int64_t>s.col - <int64_t>s.row == shift:
                            for row in range(s.row, <int64_t>s.row + s.length):
                                out[place.row + row] += self.values[s.value]

    def count_rows(self, int root, int32_t[::1] counts):
        """counts[i] += number of entries in row i."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, counts.shape[0], self.columns)
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    count_wide(self.wide + block.start, block.runs, &counts[0] + place.row)
                else:
                    count_small(self.small + block.start, block.runs, &counts[0] + place.row)

    def fill(self, int root, int64_t[::1] next_, int32_t[::1] indices, double[::1] data):
        """Append each row's columns and values at next_[row], which moves on. Columns are ascending."""
        cdef int64_t i
        cdef Place* place
        cdef Block* block
        self._check(root, next_.shape[0], self.columns)
        if self.columns > 0x7FFFFFFF:
            raise OverflowError("compressed rows number their columns with 31 bits")
        if indices.shape[0] == 0:
            return
        with nogil:
            for i in range(self.starts[root], self.starts[root + 1]):
                place = &self.places[i]
                block = &self.blocks[place.block]
                if block.wide:
                    fill_wide(self.wide + block.start, block.runs, &self.values[0], &next_[0] + place.row, place.col,
                              &indices[0], &data[0])
                else:
                    fill_small(self.small + block.start, block.runs, &self.values[0], &next_[0] + place.row, place.col,
                               &indices[0], &data[0])

    cdef int _check(self, int root, int64_t rows, int64_t columns) except -1:
        if root < 0 or root >= self.roots:
            raise IndexError(f"no matrix number {root} among {self.roots}")
        if rows != self.rows or columns != self.columns:
            raise ValueError(f"arrays of {rows} rows and {columns} columns for a matrix of {self.rows} and {self.columns}")
        return 0
