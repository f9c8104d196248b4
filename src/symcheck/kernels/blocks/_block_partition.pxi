# Partition of a quad-DAG into blocks of diagonal runs, and the occurrences of the blocks.
#
# A block is a submatrix that is stored once, as a list of diagonal runs. Unchanged variables make
# long runs; in the worst case a run is one entry.
#
# For products the rows are split into ranges of some ten thousand, each with its own list of
# occurrences. What a range reads and writes stays in cache, ranges may be computed by different
# threads, and the order of additions in a row does not depend on the threads. An occurrence that
# crosses the end of a range is in both lists, and is clipped.

cdef struct Block:
    int64_t start         # first run, in the array of its kind
    int64_t runs
    uint32_t rows
    uint32_t cols
    bint wide

cdef struct Occurrence:
    int32_t block
    uint32_t row
    uint32_t col

cdef enum:
    ABOVE = -1            # of a node: above the cut
    UNUSED = -2
    CHOSEN = -3

cdef struct RunKey:       # a run of a block under construction; `key` sorts by diagonal, then row
    uint64_t key
    uint32_t length
    uint32_t value


cdef void _sort_runs(RunKey* runs, RunKey* spare, int64_t n, bint by_length) noexcept nogil:
    """Sort stably by key or by length: insertion sort for few, otherwise radix sort over bytes that
    differ.
    """
    cdef int64_t i, j, total, c
    cdef int64_t[256] counts
    cdef RunKey cell
    cdef uint64_t varying = 0, first, k
    cdef int shift
    cdef RunKey* source = runs
    cdef RunKey* target = spare
    if n <= 32:
        for i in range(1, n):
            cell = runs[i]
            j = i
            while (j > 0 and (runs[j - 1].length > cell.length
                              if by_length else runs[j - 1].key > cell.key)):
                runs[j] = runs[j - 1]
                j -= 1
            runs[j] = cell
        return
    first = runs[0].length if by_length else runs[0].key
    for i in range(n):
        k = runs[i].length if by_length else runs[i].key
        varying |= k ^ first
    for shift in range(0, 64, 8):
        if (varying >> shift) & 255 == 0:
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
    if source != runs:
        memcpy(runs, source, n * sizeof(RunKey))


cdef void _collect_runs(const Node* nodes, int32_t node_number, uint32_t row, uint32_t col,
                        RunKey* runs, int64_t* used) noexcept nogil:
    """Append the runs below a node."""
    cdef const Node* node = &nodes[node_number]
    cdef int i
    cdef RunKey* key
    if node.value >= 0:
        key = &runs[used[0]]
        key.key = ((<uint64_t>col + ((<uint64_t>1) << 31) - row) << 32) | row
        key.length = node.rows
        key.value = <uint32_t>node.value
        used[0] += 1
        return
    for i in range(4):
        if node.edges[i].node == 0:
            return
        _collect_runs(nodes, node.edges[i].node, row + node.edges[i].row, col + node.edges[i].col,
                      runs, used)


cdef int64_t _join_runs(RunKey* runs, int64_t n) noexcept nogil:
    """Join runs that continue each other; returns how many are left."""
    cdef int64_t i, last = 0
    for i in range(1, n):
        if runs[i].value == runs[last].value and runs[i].key == runs[last].key + runs[last].length:
            runs[last].length += runs[i].length
        else:
            last += 1
            runs[last] = runs[i]
    return last + 1 if n else 0


@cython.wraparound(True)
def _boundaries(row_starts, row_ends, weights, int64_t rows, int64_t target):
    """Ends of the ranges of rows (int64[ranges + 1]), about `target` rows each, where the blocks
    crossed have few runs.
    """
    if rows <= 2 * target or len(row_starts) < 2:
        return np.array([0, rows], np.int64)
    candidates = np.unique(row_starts)
    order = np.argsort(row_ends, kind="stable")
    opened = np.concatenate([[0], np.cumsum(weights[np.argsort(row_starts, kind="stable")])])
    closed = np.concatenate([[0], np.cumsum(weights[order])])
    crossing = opened[np.searchsorted(np.sort(row_starts), candidates)]
    crossing -= closed[np.searchsorted(row_ends[order], candidates, side="right")]
    result = [0]
    while rows - result[-1] > 1.5 * target:
        low, high = np.searchsorted(candidates,
                                    [result[-1] + (target + 1) // 2, result[-1] + 3 * target // 2])
        if low < high:
            result.append(int(candidates[low + np.argmin(crossing[low:high])]))
        else:                # nothing begins there: a long run, which may be cut anywhere
            result.append(result[-1] + max(target, 1))
    return np.array([*result, rows], np.int64)


cdef class BlockPartition:
    """Distinct blocks, and for each root (matrix) their occurrences.

    Args:
        dag: the quad-DAG.
        budget: the aim for the number of runs in distinct blocks.
        ordered: for `count_entries` and `fill_rows`: one range of rows, and runs sorted by
            diagonal, so that rows get ascending columns. Otherwise for products.
        range_rows: the aim for the rows of a range; blocks of several runs have at most a quarter
            of them.
    Raises:
        MemoryError: memory ended, or there are too many occurrences.

    rows, columns: size of each matrix. roots: number of matrices. ranges: number of row ranges.
    range_bounds: int64[ranges + 1], where they begin and end. range_work: int64[ranges], the
    relative cost of a product. entries: int64[roots].
    """

    cdef Block* blocks
    cdef SmallRun* small
    cdef WideRun* wide
    cdef Occurrence* occurrences
    cdef int64_t small_count, wide_count, block_count, occurrence_count
    cdef int64_t[:, ::1] occurrence_start        # of a root in a range of rows
    cdef int64_t[::1] bounds
    cdef const double[::1] values
    cdef readonly int64_t rows, columns, roots, ranges, threshold, range_rows
    cdef readonly object entries, range_bounds, range_work  # type: Int64s

    def __cinit__(self):
        self.blocks = NULL
        self.small = NULL
        self.wide = NULL
        self.occurrences = NULL

    def __dealloc__(self):
        free(self.blocks)
        free(self.small)
        free(self.wide)
        free(self.occurrences)

    def __init__(self, QuadDag dag, int64_t budget, bint ordered=False, int64_t range_rows=32768):
        """budget: runs in distinct blocks, about; range_rows: rows of a part, about; blocks of
        several runs have a quarter.
        """
        cdef int32_t* block_of = <int32_t*>malloc(dag.builder.node_count * 4)
        if block_of == NULL:
            raise MemoryError
        self.rows, self.columns, self.range_rows = dag.rows, dag.columns, range_rows
        self.entries = dag.entries
        self.roots = len(dag.entries)
        self.values = dag.values
        try:
            self.threshold = self._choose_threshold(dag, budget, block_of)
            self._flatten_blocks(dag, block_of, ordered)
            self._list_occurrences(dag, block_of)
        finally:
            free(block_of)
        self._split_into_ranges(ordered)

    cdef int64_t _choose_threshold(self, QuadDag dag, int64_t budget, int32_t* block_of) except -1:
        """The largest threshold whose distinct blocks are within the budget, or with nearly the
        least memory.
        """
        cdef int64_t largest = 1, threshold, i
        cdef double total_runs, total_occurrences
        for i in range(self.roots):
            largest = max(largest, dag.builder.nodes[dag.roots[i].node].runs)
        sizes = []
        threshold = largest
        while True:
            total_runs, total_occurrences = self._measure(dag, threshold, block_of)
            sizes.append((threshold, 8 * total_runs + sizeof(Occurrence) * total_occurrences))
            if total_runs <= budget or threshold <= 1:
                break
            threshold = threshold * 2 // 3
        smallest = min([size for _, size in sizes])
        for threshold, size in sizes:
            if size <= max(8.0 * budget, 1.25 * smallest):
                break
        self._measure(dag, threshold, block_of)
        return threshold

    cdef tuple _measure(self, QuadDag dag, int64_t threshold, int32_t* block_of):
        """(runs in distinct blocks, number of occurrences) if nodes of at most `threshold` runs are
        blocks.

        On return block_of[node] is ABOVE, CHOSEN or UNUSED.
        """
        cdef int64_t i, n = dag.builder.node_count
        cdef double total_runs = 0, total_occurrences = 0
        cdef int e
        cdef Node* node
        cdef double* paths = <double*>malloc(n * 8)
        if paths == NULL:
            raise MemoryError
        memset(paths, 0, n * 8)
        for i in range(self.roots):
            paths[dag.roots[i].node] += 1
        with nogil:
            block_of[0] = UNUSED
            for i in range(n - 1, 0, -1):     # parents have larger numbers than their children
                node = &dag.builder.nodes[i]
                if paths[i] == 0:
                    block_of[i] = UNUSED
                elif (node.value >= 0 or (node.runs <= threshold
                                          and 4 * node.rows <= self.range_rows)):
                    block_of[i] = CHOSEN
                    total_runs += <double>node.runs
                    total_occurrences += paths[i]
                else:
                    block_of[i] = ABOVE
                    for e in range(4):
                        paths[node.edges[e].node] += paths[i]
        free(paths)
        if total_occurrences > 2e9:
            raise MemoryError("the matrix has too many blocks")
        self.occurrence_count = <int64_t>total_occurrences
        return total_runs, total_occurrences

    cdef int _flatten_blocks(self, QuadDag dag, int32_t* block_of, bint ordered) except -1:
        """Flatten each block to runs; block_of[node] becomes its number."""
        cdef int64_t i, n = dag.builder.node_count, count = 0, largest = 0, used, small_runs = 0
        cdef int64_t wide_runs = 0
        cdef RunKey* runs = NULL
        cdef Node* node
        cdef Block* block
        cdef bint wide_values = self.values.shape[0] > 65535
        for i in range(1, n):
            if block_of[i] == CHOSEN:
                count += 1
                node = &dag.builder.nodes[i]
                largest = max(largest, node.runs)
                if wide_values or node.rows > 65535 or node.cols > 65535:
                    wide_runs += node.runs
                else:
                    small_runs += node.runs
        self.blocks = <Block*>malloc((count + 1) * sizeof(Block))
        self.small = <SmallRun*>malloc((small_runs + 1) * sizeof(SmallRun))
        self.wide = <WideRun*>malloc((wide_runs + 1) * sizeof(WideRun))
        runs = <RunKey*>malloc((2 * largest + 2) * sizeof(RunKey))
        if self.blocks == NULL or self.small == NULL or self.wide == NULL or runs == NULL:
            free(runs)
            raise MemoryError
        with nogil:
            for i in range(1, n):
                if block_of[i] != CHOSEN:
                    continue
                node = &dag.builder.nodes[i]
                used = 0
                _collect_runs(dag.builder.nodes, <int32_t>i, 0, 0, runs, &used)
                _sort_runs(runs, runs + largest + 1, used, False)
                used = _join_runs(runs, used)
                if not ordered:
                    _sort_runs(runs, runs + largest + 1, used, True)
                block_of[i] = <int32_t>self.block_count
                block = &self.blocks[self.block_count]
                self.block_count += 1
                block.rows, block.cols, block.runs = node.rows, node.cols, used
                block.wide = wide_values or node.rows > 65535 or node.cols > 65535
                block.start = self.wide_count if block.wide else self.small_count
                _store_runs(self, block, runs)
        free(runs)
        self.small = <SmallRun*>realloc(self.small, (self.small_count + 1) * sizeof(SmallRun))
        self.wide = <WideRun*>realloc(self.wide, (self.wide_count + 1) * sizeof(WideRun))
        return 0

    cdef int _list_occurrences(self, QuadDag dag, const int32_t* block_of) except -1:
        """List the occurrences of the blocks, root by root, so that rows get ascending columns."""
        cdef int64_t i, capacity = self.occurrence_count
        self.occurrences = <Occurrence*>malloc((capacity + 1) * sizeof(Occurrence))
        if self.occurrences == NULL:
            raise MemoryError(f"no memory for {capacity} occurrences of blocks")
        self.occurrence_count = 0
        self.occurrence_start = np.zeros((self.roots, 2), np.int64)
        for i in range(self.roots):
            self.occurrence_start[i, 0] = self.occurrence_count
            with nogil:
                self._append_occurrences(dag.builder.nodes, block_of, dag.roots[i].node,
                                         dag.roots[i].row, dag.roots[i].col)
            self.occurrence_start[i, 1] = self.occurrence_count
        return 0

    cdef void _append_occurrences(self, const Node* nodes, const int32_t* block_of,
                                  int32_t node_number, uint32_t row, uint32_t col) noexcept nogil:
        """List the occurrences below a node."""
        cdef int e
        cdef const Node* node = &nodes[node_number]
        if node_number == 0:
            return
        if block_of[node_number] >= 0:
            self.occurrences[self.occurrence_count].block = block_of[node_number]
            self.occurrences[self.occurrence_count].row = row
            self.occurrences[self.occurrence_count].col = col
            self.occurrence_count += 1
            return
        for e in range(4):
            if node.edges[e].node == 0:
                return
            self._append_occurrences(nodes, block_of, node.edges[e].node, row + node.edges[e].row,
                                     col + node.edges[e].col)

    cdef int _split_into_ranges(self, bint whole) except -1:
        """Sort the occurrences of each root by the ranges of rows that they meet."""
        cdef int64_t i, p, root, count = self.occurrence_count, total
        cdef int64_t[::1] low = np.empty(count, np.int64), high = np.empty(count, np.int64)
        cdef int64_t[::1] weight = np.empty(count, np.int64)
        cdef int64_t[::1] first, last, bounds
        cdef int64_t[:, ::1] new_start, next_slot
        cdef Block* block
        cdef Occurrence* sorted_occurrences
        for i in range(count):
            block = &self.blocks[self.occurrences[i].block]
            low[i] = self.occurrences[i].row
            high[i] = low[i] + block.rows
            weight[i] = block.runs if block.runs > 1 else 0
        self.range_bounds = (np.array([0, self.rows], np.int64)
                             if whole else _boundaries(np.asarray(low), np.asarray(high),
                                                       np.asarray(weight), self.rows,
                                                       self.range_rows))
        self.ranges = len(self.range_bounds) - 1
        self.bounds = bounds = self.range_bounds
        first = np.searchsorted(self.range_bounds, np.asarray(low), side="right") - 1
        last = np.searchsorted(self.range_bounds, np.asarray(high), side="left") - 1
        new_start = np.zeros((self.roots, self.ranges + 1), np.int64)
        for root in range(self.roots):
            for i in range(self.occurrence_start[root, 0], self.occurrence_start[root, 1]):
                for p in range(first[i], last[i] + 1):
                    new_start[root, p + 1] += 1
        total = 0
        for root in range(self.roots):
            new_start[root, 0] = total
            for p in range(self.ranges):
                total += new_start[root, p + 1]
                new_start[root, p + 1] = total
        sorted_occurrences = <Occurrence*>malloc((total + 1) * sizeof(Occurrence))
        if sorted_occurrences == NULL:
            raise MemoryError
        next_slot = np.array(new_start)
        for root in range(self.roots):
            for i in range(self.occurrence_start[root, 0], self.occurrence_start[root, 1]):
                for p in range(first[i], last[i] + 1):
                    sorted_occurrences[next_slot[root, p]] = self.occurrences[i]
                    next_slot[root, p] += 1
        free(self.occurrences)
        self.occurrences, self.occurrence_count, self.occurrence_start = (sorted_occurrences,
                                                                          total, new_start)
        self.range_work = self._work()
        return 0

    def _work(self):
        """Relative cost of a product, per range: the runs of its occurrences."""
        cdef int64_t root, p, i
        cdef int64_t[::1] work = np.zeros(self.ranges, np.int64)
        for root in range(self.roots):
            for p in range(self.ranges):
                for i in range(self.occurrence_start[root, p], self.occurrence_start[root, p + 1]):
                    work[p] += 4 + self.blocks[self.occurrences[i].block].runs
        return np.asarray(work)

    @property
    def nbytes(self) -> int:
        """Memory of the runs, blocks, occurrences and values, in bytes."""
        return (self.small_count * sizeof(SmallRun) + self.wide_count * sizeof(WideRun)
                + self.block_count * sizeof(Block) + self.occurrence_count * sizeof(Occurrence)
                + self.values.shape[0] * 8 + self.occurrence_start.size * 8 + self.bounds.size * 16)

    @property
    def statistics(self) -> Mapping[str, int]:
        """Number of distinct blocks, runs, wide runs, occurrences, ranges and entries, and the
        threshold.
        """
        return {"blocks": self.block_count, "runs": self.small_count + self.wide_count,
                "wide_runs": self.wide_count, "occurrences": self.occurrence_count,
                "ranges": self.ranges, "entries": int(self.entries.sum()),
                "threshold": self.threshold}

    def describe(self) -> tuple[Int64s, Int64s]:
        """The blocks and their occurrences, for display.

        Returns:
            blocks: int64[blocks, 3], rows, columns and runs of each.
            occurrences: int64[occurrences, 4], root, block, and the row and column of the corner;
                an occurrence that crosses the end of a range of rows is listed in both.
        """
        cdef int64_t i, root
        blocks, occurrences = (np.empty((self.block_count, 3), np.int64),
                               np.empty((self.occurrence_count, 4), np.int64))
        cdef int64_t[:, ::1] b = blocks, o = occurrences
        for i in range(self.block_count):
            b[i, 0], b[i, 1], b[i, 2] = (self.blocks[i].rows, self.blocks[i].cols,
                                         self.blocks[i].runs)
        for root in range(self.roots):
            for i in range(self.occurrence_start[root, 0],
                           self.occurrence_start[root, self.ranges]):
                o[i, 0], o[i, 1], o[i, 2], o[i, 3] = (root, self.occurrences[i].block,
                                                      self.occurrences[i].row,
                                                      self.occurrences[i].col)
        return blocks, occurrences

    cdef int64_t _longest_range(self):
        """The most rows of a range, plus 1."""
        return int(np.diff(self.range_bounds).max()) + 1

    cdef int64_t _check_arguments(self, int root, int64_t rows, int64_t columns, int64_t first,
                                  int64_t last) except -1:
        """Check the sizes of arrays and a span of ranges; returns the end of the span."""
        if root < 0 or root >= max(self.roots, 1):
            raise IndexError(f"no matrix number {root} among {self.roots}")
        if rows != self.rows or columns != self.columns:
            expected = f"{self.rows} rows and {self.columns} columns"
            raise ValueError(f"arrays of {rows} rows and {columns} columns, not {expected}")
        last = self.ranges if last < 0 else last
        if first < 0 or last > self.ranges:
            raise IndexError(f"row ranges {first} to {last} of {self.ranges}")
        return last


cdef void _store_runs(BlockPartition partition, Block* block, const RunKey* runs) noexcept nogil:
    """Write the runs of a block in its form."""
    cdef int64_t j
    cdef uint32_t row, col
    cdef WideRun* wide = partition.wide + block.start
    cdef SmallRun* small = partition.small + block.start
    for j in range(block.runs):
        row = <uint32_t>runs[j].key
        col = <uint32_t>((runs[j].key >> 32) + row - ((<uint64_t>1) << 31))
        if block.wide:
            wide[j].row, wide[j].col, wide[j].length, wide[j].value = (row, col, runs[j].length,
                                                                       runs[j].value)
        else:
            small[j].row, small[j].col = <uint16_t>row, <uint16_t>col
            small[j].length, small[j].value = <uint16_t>runs[j].length, <uint16_t>runs[j].value
    if block.wide:
        partition.wide_count += block.runs
    else:
        partition.small_count += block.runs
