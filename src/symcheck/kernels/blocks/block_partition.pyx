# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Cutting a quad-DAG into blocks of diagonal runs, and listing the places where they stand.

Cutting the DAG where the distinct sub-matrices are few gives blocks: lists of runs, stored once. A run is a constant
along a diagonal, which is what unchanged variables look like, so that most runs are long; in the worst case a run is one
entry.

For products the rows are parted into ranges of some ten thousand, each with its own list of places: what a range
reads and writes stays in cache, ranges may be done by different threads, and the order of additions in a row does not
depend on who does them. A place that crosses a range's end is in both lists, and is clipped.
"""
from libc.stdint cimport int32_t, int64_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc, realloc
from libc.string cimport memcpy, memset

cimport cython
import numpy as np

from symcheck.kernels.blocks.diagonal_runs cimport SmallRun, WideRun
from symcheck.kernels.diagrams.quad_dag cimport Node, Quad

__all__ = ["Cut"]

cdef enum:
    ABOVE = -1            # of a node: above the cut
    UNUSED = -2
    CHOSEN = -3

cdef struct Cell:         # a run while its block is made: `key` sorts by diagonal, then row
    uint64_t key
    uint32_t length
    uint32_t value


cdef void _sort(Cell* cells, Cell* spare, int64_t n, bint by_length) noexcept nogil:
    """Stably by key or by length, ascending: insertion for few, otherwise by bytes, leaving out those that are all alike."""
    cdef int64_t i, j, total, c
    cdef int64_t[256] counts
    cdef Cell cell
    cdef uint64_t every = 0, first, k
    cdef int shift
    cdef Cell* source = cells
    cdef Cell* target = spare
    if n <= 32:
        for i in range(1, n):
            cell = cells[i]
            j = i
            while j > 0 and (cells[j - 1].length > cell.length if by_length else cells[j - 1].key > cell.key):
                cells[j] = cells[j - 1]
                j -= 1
            cells[j] = cell
        return
    first = cells[0].length if by_length else cells[0].key
    for i in range(n):
        k = cells[i].length if by_length else cells[i].key
        every |= k ^ first
    for shift in range(0, 64, 8):
        if (every >> shift) & 255 == 0:
            continue
        memset(counts, 0, sizeof(counts))
        for i in range(n):
            k = source[i].length if by_length else source[i].key
            counts[(k >> shift) & 255] += 1
        total = 0
        for i in range(256):
            c = counts[i]
            counts[i] = total
            total += c
        for i in range(n):
            k = source[i].length if by_length else source[i].key
            c = (k >> shift) & 255
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


@cython.wraparound(True)
def _boundaries(starts, ends, weights, int64_t rows, int64_t size):
    """Ends of the ranges of rows (int64[parts + 1]), about `size` each, where places of little weight are crossed."""
    if rows <= 2 * size or len(starts) < 2:
        return np.array([0, rows], np.int64)
    candidates = np.unique(starts)
    order = np.argsort(ends, kind="stable")
    opened = np.concatenate([[0], np.cumsum(weights[np.argsort(starts, kind="stable")])])
    closed = np.concatenate([[0], np.cumsum(weights[order])])
    crossing = opened[np.searchsorted(np.sort(starts), candidates)] - closed[np.searchsorted(ends[order], candidates, side="right")]
    result = [0]
    while rows - result[-1] > 1.5 * size:
        low, high = np.searchsorted(candidates, [result[-1] + (size + 1) // 2, result[-1] + 3 * size // 2])
        if low < high:
            result.append(int(candidates[low + np.argmin(crossing[low:high])]))
        else:                # nothing begins there: a long run, which may be cut anywhere
            result.append(result[-1] + max(size, 1))
    return np.array([*result, rows], np.int64)


cdef void _store(Cut cut, Block* block, const Cell* cells) noexcept nogil:
    cdef int64_t j
    cdef uint32_t row, col
    cdef WideRun* wide = cut.wide + block.start
    cdef SmallRun* small = cut.small + block.start
    for j in range(block.runs):
        row = <uint32_t>cells[j].key
        col = <uint32_t>((cells[j].key >> 32) + row - ((<uint64_t>1) << 31))
        if block.wide:
            wide[j].row, wide[j].col, wide[j].length, wide[j].value = row, col, cells[j].length, cells[j].value
        else:
            small[j].row, small[j].col = <uint16_t>row, <uint16_t>col
            small[j].length, small[j].value = <uint16_t>cells[j].length, <uint16_t>cells[j].value
    if block.wide:
        cut.wide_used += block.runs
    else:
        cut.small_used += block.runs


cdef class Cut:
    """Distinct blocks, and for each root (matrix) the places where they stand.

    ordered: for `count_rows` and `fill`, one part, runs by diagonal, so that rows come with ascending columns;
    otherwise for products. parts: number of row ranges, `part_rows` (int64[parts + 1]) where they begin and end.
    """

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

    def __init__(self, Quad quad, int64_t budget, bint ordered=False, int64_t range_rows=32768):
        """budget: runs in distinct blocks, about; range_rows: rows of a part, about; blocks of several runs have a quarter."""
        cdef int32_t* block_of = <int32_t*>malloc(quad.w.used * 4)
        if block_of == NULL:
            raise MemoryError
        self.rows, self.columns, self.range_rows = quad.rows, quad.columns, range_rows
        self.entries = quad.entries
        self.roots = len(quad.entries)
        self.values = quad.table_values
        try:
            self.threshold = self._choose(quad, budget, block_of)
            self._compile(quad, block_of, ordered)
            self._stand(quad, block_of)
        finally:
            free(block_of)
        self._part(ordered)

    cdef int64_t _choose(self, Quad quad, int64_t budget, int32_t* block_of) except -1:
        """The largest threshold at which the distinct blocks are within the budget, or the memory near its minimum."""
        cdef int64_t largest = 1, threshold, i
        cdef double runs, places
        for i in range(self.roots):
            largest = max(largest, quad.w.nodes[quad.roots[i].node].runs)
        sizes = []
        threshold = largest
        while True:
            runs, places = self._measure(quad, threshold, block_of)
            sizes.append((threshold, 8 * runs + sizeof(Place) * places))
            if runs <= budget or threshold <= 1:
                break
            threshold = threshold * 2 // 3
        least = min([size for _, size in sizes])
        for threshold, size in sizes:
            if size <= max(8.0 * budget, 1.25 * least):
                break
        self._measure(quad, threshold, block_of)
        return threshold

    cdef tuple _measure(self, Quad quad, int64_t threshold, int32_t* block_of):
        """(runs in distinct blocks, number of places) when nodes of at most `threshold` runs are blocks.

        On return block_of[node] is ABOVE, CHOSEN or UNUSED.
        """
        cdef int64_t i, n = quad.w.used
        cdef double runs = 0, places = 0
        cdef int e
        cdef Node* node
        cdef double* paths = <double*>malloc(n * 8)
        if paths == NULL:
            raise MemoryError
        memset(paths, 0, n * 8)
        for i in range(self.roots):
            paths[quad.roots[i].node] += 1
        with nogil:
            block_of[0] = UNUSED
            for i in range(n - 1, 0, -1):     # parents have larger numbers than their children
                node = &quad.w.nodes[i]
                if paths[i] == 0:
                    block_of[i] = UNUSED
                elif node.value >= 0 or (node.runs <= threshold and 4 * node.rows <= self.range_rows):
                    block_of[i] = CHOSEN
                    runs += <double>node.runs
                    places += paths[i]
                else:
                    block_of[i] = ABOVE
                    for e in range(4):
                        paths[node.edges[e].node] += paths[i]
        free(paths)
        if places > 2e9:
            raise MemoryError("the matrix has too many blocks")
        self.places_used = <int64_t>places
        return runs, places

    cdef int _compile(self, Quad quad, int32_t* block_of, bint ordered) except -1:
        """Flatten each block to runs; block_of[node] becomes its number."""
        cdef int64_t i, n = quad.w.used, count = 0, largest = 0, used, small_runs = 0, wide_runs = 0
        cdef Cell* cells = NULL
        cdef Node* node
        cdef Block* block
        cdef bint many = self.values.shape[0] > 65535
        for i in range(1, n):
            if block_of[i] == CHOSEN:
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
                if block_of[i] != CHOSEN:
                    continue
                node = &quad.w.nodes[i]
                used = 0
                _cells(quad.w.nodes, <int32_t>i, 0, 0, cells, &used)
                _sort(cells, cells + largest + 1, used, False)
                used = _join(cells, used)
                if not ordered:
                    _sort(cells, cells + largest + 1, used, True)
                block_of[i] = <int32_t>self.blocks_used
                block = &self.blocks[self.blocks_used]
                self.blocks_used += 1
                block.rows, block.cols, block.runs = node.rows, node.cols, used
                block.wide = many or node.rows > 65535 or node.cols > 65535
                block.start = self.wide_used if block.wide else self.small_used
                _store(self, block, cells)
        free(cells)
        self.small = <SmallRun*>realloc(self.small, (self.small_used + 1) * sizeof(SmallRun))
        self.wide = <WideRun*>realloc(self.wide, (self.wide_used + 1) * sizeof(WideRun))
        return 0

    cdef int _stand(self, Quad quad, const int32_t* block_of) except -1:
        """List the places of the blocks, root by root, in an order that gives each row ascending columns."""
        cdef int64_t i, room = self.places_used
        self.places = <Place*>malloc((room + 1) * sizeof(Place))
        if self.places == NULL:
            raise MemoryError(f"no memory for {room} block places")
        self.places_used = 0
        self.starts = np.zeros((self.roots, 2), np.int64)
        for i in range(self.roots):
            self.starts[i, 0] = self.places_used
            with nogil:
                self._stand_at(quad.w.nodes, block_of, quad.roots[i].node, quad.roots[i].row, quad.roots[i].col)
            self.starts[i, 1] = self.places_used
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

    cdef int _part(self, bint whole) except -1:
        """Sort the places of each root by the ranges of rows that they meet."""
        cdef int64_t i, p, root, n = self.places_used, total
        cdef int64_t[::1] low = np.empty(n, np.int64), high = np.empty(n, np.int64), weight = np.empty(n, np.int64)
        cdef int64_t[::1] first, last, bounds
        cdef int64_t[:, ::1] starts, following
        cdef Block* block
        cdef Place* sorted_
        for i in range(n):
            block = &self.blocks[self.places[i].block]
            low[i] = self.places[i].row
            high[i] = low[i] + block.rows
            weight[i] = block.runs if block.runs > 1 else 0
        self.part_rows = np.array([0, self.rows], np.int64) if whole else _boundaries(
            np.asarray(low), np.asarray(high), np.asarray(weight), self.rows, self.range_rows)
        self.parts = len(self.part_rows) - 1
        self.bounds = bounds = self.part_rows
        first = np.searchsorted(self.part_rows, np.asarray(low), side="right") - 1
        last = np.searchsorted(self.part_rows, np.asarray(high), side="left") - 1
        starts = np.zeros((self.roots, self.parts + 1), np.int64)
        for root in range(self.roots):
            for i in range(self.starts[root, 0], self.starts[root, 1]):
                for p in range(first[i], last[i] + 1):
                    starts[root, p + 1] += 1
        total = 0
        for root in range(self.roots):
            starts[root, 0] = total
            for p in range(self.parts):
                total += starts[root, p + 1]
                starts[root, p + 1] = total
        sorted_ = <Place*>malloc((total + 1) * sizeof(Place))
        if sorted_ == NULL:
            raise MemoryError
        following = np.array(starts)
        for root in range(self.roots):
            for i in range(self.starts[root, 0], self.starts[root, 1]):
                for p in range(first[i], last[i] + 1):
                    sorted_[following[root, p]] = self.places[i]
                    following[root, p] += 1
        free(self.places)
        self.places, self.places_used, self.starts = sorted_, total, starts
        self.part_work = self._work()
        return 0

    def _work(self):
        """Per part, about what a product costs: runs and entries (of a sample of its places)."""
        cdef int64_t root, p, i
        cdef int64_t[::1] work = np.zeros(self.parts, np.int64)
        for root in range(self.roots):
            for p in range(self.parts):
                for i in range(self.starts[root, p], self.starts[root, p + 1]):
                    work[p] += 4 + self.blocks[self.places[i].block].runs
        return np.asarray(work)

    @property
    def nbytes(self):
        """Memory of the runs, blocks, places and values, in bytes."""
        return (self.small_used * sizeof(SmallRun) + self.wide_used * sizeof(WideRun) + self.blocks_used * sizeof(Block)
                + self.places_used * sizeof(Place) + self.values.shape[0] * 8 + self.starts.size * 8 + self.bounds.size * 16)

    @property
    def statistics(self):
        """Sizes: distinct blocks, their runs (and how many of them in wide form), places, runs at all places, parts, entries."""
        return {"blocks": self.blocks_used, "runs": self.small_used + self.wide_used, "wide_runs": self.wide_used,
                "places": self.places_used, "stamped": int(self.part_work.sum()) - 4 * self.places_used, "parts": self.parts,
                "entries": int(self.entries.sum()), "threshold": self.threshold}

    def listing(self):
        """What stands where, for people: (blocks, places).

        blocks: int64[blocks, 3], rows, columns and runs of each. places: int64[places, 4], root, block, and the row and column
        of its corner; a place that crosses the end of a range of rows is listed in both.
        """
        cdef int64_t i, root
        blocks, places = np.empty((self.blocks_used, 3), np.int64), np.empty((self.places_used, 4), np.int64)
        cdef int64_t[:, ::1] b = blocks, p = places
        for i in range(self.blocks_used):
            b[i, 0], b[i, 1], b[i, 2] = self.blocks[i].rows, self.blocks[i].cols, self.blocks[i].runs
        for root in range(self.roots):
            for i in range(self.starts[root, 0], self.starts[root, self.parts]):
                p[i, 0], p[i, 1], p[i, 2], p[i, 3] = root, self.places[i].block, self.places[i].row, self.places[i].col
        return blocks, places

    cdef int64_t _longest(self):
        return int(np.diff(self.part_rows).max()) + 1

    cdef int64_t _check(self, int root, int64_t rows, int64_t columns, int64_t first, int64_t last) except -1:
        if root < 0 or root >= max(self.roots, 1):
            raise IndexError(f"no matrix number {root} among {self.roots}")
        if rows != self.rows or columns != self.columns:
            raise ValueError(f"arrays of {rows} rows and {columns} columns for a matrix of {self.rows} and {self.columns}")
        last = self.parts if last < 0 else last
        if first < 0 or last > self.parts:
            raise IndexError(f"parts {first} to {last} of {self.parts}")
        return last
