# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Partition refinement on diagrams: states are never enumerated, and blocks are leaves of a
diagram.

Nodes are stored once, in arrays of this module. A node has a bit (the number of a row bit) and two
children; a negative child is the leaf -1 - child. In a partition the leaves are blocks, and 0 is no
state. In a signature they are sparse vectors (see _signature_table.pxi) from blocks to sums of
entries, or sets of these. A signature is the product of a matrix and the partition, summed over the
column bits. Results are memoised across rounds, as long as blocks keep their numbers.

Source: Wimmer, Derisavi & Hermanns (2010), with blocks and signatures as leaves instead of
encodings; Derisavi (2007) for symbolic lumping; Valmari & Franceschinis (2010) for keeping block
numbers.
"""

from libc.limits cimport LLONG_MAX
from libc.math cimport frexp, ldexp
from libc.stdint cimport int32_t, int64_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcmp, memcpy, memset

import cython
import numpy as np

from symcheck.kernels.tables.hash_mix cimport double_bits, mix, mix_pair, round_to_44_bits
from symcheck.kernels.tables.pair_map cimport (PairMap, pair_key, pair_map_clear, pair_map_find,
                                               pair_map_insert)
from symcheck.kernels.diagrams.odd cimport MAX_NODES
from symcheck.kernels.memory cimport Buffer, release, reserve
from symcheck.kernels.portable cimport (Wide, wide_double, wide_high, wide_left, wide_low, wide_of,
                                        wide_right, wide_sum)
from symcheck.kernels.tuning cimport CHECK_INTERVAL, COLLECTION_GROWTH, FIRST_COLLECTION

__all__ = ["Partition", "largest_row_sum"]

cdef extern from "Python.h":
    int PyErr_CheckSignals() noexcept

cdef enum:
    EMPTY = -1                 # the leaf 0: no state, the empty signature

cdef enum Stop:
    RUNNING, OUT_OF_MEMORY, SIGNAL, OUT_OF_BUDGET


cdef int raise_pending() except -1:
    """Raise the exception of a signal."""
    return -1


def largest_row_sum(const int[::1] level, const int[::1] low, const int[::1] high,
                    const double[::1] weight, const int[::1] roots) -> float:
    """An upper bound on the sum of each row of the matrices (arrays as in Partition)."""
    bounds = np.zeros(level.shape[0], dtype=np.float64)
    cdef double[::1] bound = bounds
    cdef double a, b, most = 0.0
    cdef Py_ssize_t i
    for i in range(level.shape[0]):
        if i < weight.shape[0]:
            bound[i] = weight[i]
            continue
        a = bound[low[i]] * 2.0 ** free_column_bits(level[i], level[low[i]])
        b = bound[high[i]] * 2.0 ** free_column_bits(level[i], level[high[i]])
        bound[i] = a + b if level[i] & 1 else max(a, b)
    for i in range(roots.shape[0]):
        most = max(most, bound[roots[i]] * 2.0 ** free_column_bits(-1, level[roots[i]]))
    return most


cdef inline int free_column_bits(int above, int image_below) noexcept nogil:
    """Number of column levels (odd) between two levels."""
    return image_below // 2 - (above + 1) // 2


include "_signature_table.pxi"
include "_nodes.pxi"
include "_signatures.pxi"
include "_splitting.pxi"


@cython.final
cdef class Partition(Splitting):
    """A partition of a set of states, which is refined until it is a bisimulation.

    Args:
        bits: number of bits of a state.
        level, low, high, weight, roots: the matrices as an exported diagram, leaves first, with
            values `weight` (int32[nodes] three times, float64[leaves], int32[roots]). The level of
            a node is twice the number of its bit, plus 1 for a column bit; leaves have level 2 *
            bits.
        choices: whether the matrices are the choices of a state, whose signatures form a set.
        exponent: minus the exponent of the lowest binary digit of the weights; sums must stay below
            2 ** (126 - exponent).
        limit: bytes that may be used.

    `budget` is the number of operations (nodes made and pairs of nodes visited) after which to
    stop, `operations`, `blocks` and `rounds` the progress, and `threshold` the number of nodes at
    which unused ones are collected. Methods raise MemoryError at the limit and OverflowError beyond
    the budget; the partition is then useless.

    Methods take diagrams over the row bits as level (int32, number of the bit; `bits` at leaves),
    low, high (int32), the numbers or values of the leaves, and a root.
    """

    cdef public long long threshold
    cdef readonly long long rounds
    cdef list rewards            # per root: the diagram of the rewards of its rows

    def __cinit__(self, int bits, const int[::1] level, const int[::1] low, const int[::1] high,
                  const double[::1] weight, const int[::1] roots, bint choices, int exponent,
                  long long limit):
        self.bits = bits
        self.level = level
        self.low = low
        self.high = high
        self.weight = weight
        self.leaves = <int>weight.shape[0]
        self.roots = roots
        self.choices = choices
        self.limit = limit
        self.budget = LLONG_MAX
        self.threshold = FIRST_COLLECTION
        self.signatures = SignatureTable(exponent)
        self.rewards = [EMPTY] * roots.shape[0]
        self.root = EMPTY
        self.mask = 1023
        self.table = <int32_t*>malloc(1024 * sizeof(int32_t))
        if self.table == NULL or reserve(&self.block_storage, 2 * sizeof(Block)):
            raise MemoryError
        memset(self.table, 0xFF, 1024 * sizeof(int32_t))

    def __dealloc__(self):
        free(self.table)
        release(&self.storage)
        release(&self.split_storage)
        release(&self.block_storage)
        release(&self.stable_nodes)
        release(&self.visit_round)
        self.forget()

    cdef void forget(self) noexcept nogil:
        """Drop all memoised results."""
        pair_map_clear(&self.images)
        pair_map_clear(&self.sums)
        pair_map_clear(&self.unions)
        pair_map_clear(&self.scales)
        pair_map_clear(&self.stable)
        pair_map_clear(&self.visited_pairs)
        pair_map_clear(&self.split_numbers)
        pair_map_clear(&self.new_nodes)

    @property
    def memory(self) -> int:
        """Memory held, in bytes."""
        return self.bytes_used()

    @property
    def size(self) -> int:
        """Number of nodes and signatures."""
        return self.nodes + self.signatures.count

    cdef int64_t bytes_used(self) noexcept nogil:
        cdef int64_t entries = (self.images.capacity + self.sums.capacity + self.unions.capacity
                                + self.scales.capacity + self.stable.capacity
                                + self.visited_pairs.capacity + self.split_numbers.capacity
                                + self.new_nodes.capacity)
        return 16 * entries + self.signatures.nbytes() + Nodes.bytes_used(self)

    # ---------------------------------------------------------------------------------------- from
    # outside

    cdef int import_diagram(self, const int[::1] level, const int[::1] low, const int[::1] high,
                            const int[::1] leaves, int root) except? -2:
        """A diagram over row bits as a node; leaf i becomes the leaf number leaves[i]."""
        cdef Py_ssize_t i, n = level.shape[0]
        node = np.empty(n, dtype=np.int32)
        cdef int[::1] view = node
        for i in range(leaves.shape[0]):
            view[i] = -1 - leaves[i]
        for i in range(leaves.shape[0], n):
            view[i] = self.make(level[i], view[low[i]], view[high[i]])
        self.raise_if_stopped()
        return view[root]

    def start(self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s, int root):
        """Begin with a set of states (leaves 0 and 1) as the only block."""
        self.root = self.import_diagram(level, low, high, leaves, root)
        self.blocks = self.root != EMPTY
        self.rounds = 0
        self.block(0)[0] = self.block(1)[0] = Block(-1, 0)

    def separate(self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s, int root):
        """Separate states at which a function of the row bits differs; leaves are numbered from 0.
        """
        self.refine(self.import_diagram(level, low, high, leaves, root), False)
        self.invalidate_signatures()

    def separate_rows(self, int choice, int structure, level: Int32s, low: Int32s, high: Int32s,
                      const double[::1] values, int root):
        """Separate rows of a matrix at which a reward differs.

        Args:
            choice: number of the matrix. structure: number of the reward structure.
            values: float64[leaves], the rewards.
        """
        cdef Py_ssize_t i
        vectors = np.zeros(values.shape[0], dtype=np.int32)
        for i in range(values.shape[0]):
            if values[i] != 0.0:
                vectors[i] = self.signatures.singleton(-1 - structure, values[i])
                if vectors[i] < 0:
                    raise MemoryError
        cdef int s = self.import_diagram(level, low, high, vectors, root), r = self.rewards[choice]
        r = self.sum(r, s)
        self.raise_if_stopped()
        self.rewards[choice] = r

    def step(self) -> bool:
        """One round of refinement; whether it made new blocks."""
        cdef int64_t blocks_before = self.blocks
        cdef Py_ssize_t i
        cdef int s, signature_sum = EMPTY, reward
        if self.operations > self.budget:
            raise OverflowError
        if self.nodes > self.threshold:
            self.collect()
        for i in range(self.roots.shape[0]):
            reward = self.rewards[i]
            with nogil:
                s = self.sum(self.image_below(self.roots[i], self.root, -1), reward)
                if self.choices:
                    signature_sum = self.union(signature_sum, s)
                else:
                    signature_sum = s
            self.raise_if_stopped()
        self.refine(signature_sum, True)
        self.rounds += 1
        return self.blocks > blocks_before

    cdef void invalidate_signatures(self):
        """Forget the signatures of the blocks."""
        cdef int64_t b
        pair_map_clear(&self.stable)
        for b in range(self.blocks + 1):
            self.block(b).signature = -1

    cdef int import_node(self, SignatureTable old, const Node* nodes, int x,
                         bint of_signatures) noexcept nogil:
        """A node of an array that is being replaced, in the new one."""
        cdef int r, low, high
        if x == EMPTY or self.stop != RUNNING:
            return EMPTY
        if x < 0:
            return self.leaf(self.signatures.import_vector(old, -1 - x)) if of_signatures else x
        if pair_map_find(&self.new_nodes, x, 0, &r):
            return r
        low = self.import_node(old, nodes, nodes[x].low, of_signatures)
        high = self.import_node(old, nodes, nodes[x].high, of_signatures)
        return self.memoise(&self.new_nodes, x, 0, self.make(nodes[x].bit, low, high))

    cdef int collect(self) except -1:
        """Drop all nodes but those of the partition and the rewards, and all memoised results."""
        cdef Buffer storage = self.storage
        cdef const Node* nodes = <Node*>storage.data
        cdef SignatureTable old = self.signatures
        self.forget()
        self.storage = Buffer(NULL, 0, 0)
        self.nodes = 0
        self.signatures = SignatureTable(old.exponent)
        memset(self.table, 0xFF, (self.mask + 1) * sizeof(int32_t))
        self.root = self.import_node(old, nodes, self.root, False)
        pair_map_clear(&self.new_nodes)
        self.rewards = [self.import_node(old, nodes, r, True) for r in self.rewards]
        pair_map_clear(&self.new_nodes)
        release(&storage)
        self.invalidate_signatures()
        self.threshold = max(self.threshold, COLLECTION_GROWTH * self.nodes)
        return self.raise_if_stopped()

    def blocks_meeting(self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s,
                       int root) -> Int64s:
        """The blocks that meet a set (leaves 0 and 1), ascending: int64."""
        cdef int64_t i
        cdef int x = self.import_diagram(level, low, high, leaves, root)
        self.rounding = False
        self.splits = 0
        pair_map_clear(&self.visited_pairs)
        pair_map_clear(&self.split_numbers)
        self.collect_blocks(self.root, x)
        self.raise_if_stopped()
        return np.array(sorted([self.split(i).block for i in range(self.splits)]), dtype=np.int64)

    cdef void collect_blocks(self, int p, int s) noexcept nogil:
        """Collect the blocks with a state in a set, as splits."""
        cdef int r, bit, p0, p1, s0, s1
        if (p == EMPTY or s == EMPTY or self.stop != RUNNING
                or pair_map_find(&self.visited_pairs, p, s, &r)):
            return
        self.memoise(&self.visited_pairs, p, s, 0)
        if p < 0 and s < 0:
            self.add_split(-1 - p, EMPTY)
            return
        bit = min(self.bit_of(p), self.bit_of(s))
        self.children(p, bit, &p0, &p1)
        self.children(s, bit, &s0, &s1)
        self.collect_blocks(p0, s0)
        self.collect_blocks(p1, s1)

    # ---------------------------------------------------------------------------------------- the
    # blocks

    def first_members(self) -> tuple[Int64s, Masks]:
        """The blocks by their first members.

        Returns:
            order: int64[blocks]; members: uint8[blocks, bits].
        """
        order = np.zeros(self.blocks, dtype=np.int64)
        members = np.zeros((self.blocks, max(1, self.bits)), dtype=np.uint8)
        visited = np.zeros(self.nodes + 1, dtype=np.uint8)
        last_seen = np.zeros(self.blocks + 1, dtype=np.uint8)
        path = np.zeros(max(1, self.bits), dtype=np.uint8)
        cdef int64_t n = 0
        self.collect_first_members(self.root, visited, last_seen, path, order, members, &n)
        return order, members[:, : self.bits]

    cdef int collect_first_members(self, int x, unsigned char[::1] visited,
                                   unsigned char[::1] last_seen, unsigned char[::1] path,
                                   long long[::1] order, unsigned char[:, ::1] members,
                                   int64_t* n) except -1:
        """Visit the nodes below x in the order of states, and note the first member of each block.
        """
        cdef int bit
        if x == EMPTY:
            return 0
        if x < 0:
            if not last_seen[-1 - x]:
                last_seen[-1 - x] = 1
                order[n[0]] = -1 - x
                members[n[0], :] = path
                n[0] += 1
            return 0
        if visited[x]:
            return 0
        visited[x] = 1
        bit = self.node(x).bit
        self.collect_first_members(self.node(x).low, visited, last_seen, path, order,
                                   members, n)
        path[bit] = 1
        self.collect_first_members(self.node(x).high, visited, last_seen, path, order,
                                   members, n)
        path[bit] = 0
        return 0

    def diagram(self) -> tuple[Int32s, Int32s, Int32s, int]:
        """The partition as a diagram (bit, low, high, root).

        Numbers up to `blocks` are the leaves; nodes follow, children first.
        """
        cdef int64_t count = 0, i, base = self.blocks + 1
        number = np.full(self.nodes + 1, -1, dtype=np.int64)
        cdef long long[::1] view = number
        self.number_nodes(self.root, view, &count)
        cdef int n = <int>(base + count)
        bit = np.full(n, self.bits, dtype=np.int32)
        low = np.arange(n, dtype=np.int32)
        high = np.arange(n, dtype=np.int32)
        cdef int[::1] node_bits = bit, lows = low, highs = high
        for i in range(self.nodes):
            if view[i] >= 0:
                node_bits[base + view[i]] = self.node(i).bit
                lows[base + view[i]] = self.export_id(self.node(i).low, view, base)
                highs[base + view[i]] = self.export_id(self.node(i).high, view, base)
        return bit, low, high, self.export_id(self.root, view, base)

    cdef int export_id(self, int x, long long[::1] number, int64_t base):
        """The exported number of a node or leaf."""
        return -1 - x if x < 0 else <int>(base + number[x])

    cdef int number_nodes(self, int x, long long[::1] number, int64_t* count) except -1:
        """Number the nodes below x, children first."""
        if x < 0 or number[x] >= 0:
            return 0
        self.number_nodes(self.node(x).low, number, count)
        self.number_nodes(self.node(x).high, number, count)
        number[x] = count[0]
        count[0] += 1
        return 0

    def rows(self, const long long[::1] order) -> tuple[Int64s, Int64s, Int32s, Floats]:
        """The signatures of blocks as compressed rows, after a step that split nothing.

        Args:
            order: int64[n], the blocks.
        Returns:
            groups: int64[n+1]; indptr: int64[rows+1]; keys: int32, a block, or -1 - structure for a
                reward;
            values: float64.
        """
        cdef Py_ssize_t i, j, n = order.shape[0], rows = 0, entries = 0
        cdef int s, row
        cdef int64_t k
        groups = np.zeros(n + 1, dtype=np.int64)
        cdef long long[::1] group = groups
        for i in range(n):
            s = self.block(order[i]).signature
            group[i + 1] = group[i] + (self.signatures.length(s) if self.choices else 1)
        indptr = np.zeros(group[n] + 1, dtype=np.int64)
        cdef long long[::1] starts = indptr
        for i in range(n):
            for j in range(group[i + 1] - group[i]):
                starts[rows + 1] = starts[rows] + self.signatures.length(self.row(<int>order[i], j))
                rows += 1
        keys = np.empty(starts[rows], dtype=np.int32)
        values = np.empty(starts[rows], dtype=np.float64)
        cdef int[::1] key = keys
        cdef double[::1] value = values
        for i in range(n):
            for j in range(group[i + 1] - group[i]):
                row = self.row(<int>order[i], j)
                for k in range(self.signatures.length(row)):
                    key[entries] = self.signatures.keys_of(row)[k]
                    value[entries] = self.signatures.value(row, k)
                    entries += 1
        return groups, indptr, keys, values

    cdef int row(self, int block, Py_ssize_t which) noexcept nogil:
        """The signature of a row of a block before it was rounded."""
        cdef int s = self.block(block).signature
        return self.signatures.unrounded(self.signatures.keys_of(s)[which] if self.choices else s)
