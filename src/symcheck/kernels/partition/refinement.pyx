# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Partition refinement on diagrams: the states of a huge set are never listed, their blocks are the
leaves of a diagram.

Nodes are kept once, in arrays of this module's own. A node has a place (the number of a row bit)
and two children; a child that is negative is the leaf -1 - child. In a partition leaves are blocks,
0 being no state; in a signature they are bags (see bags.pyx) from blocks to sums of entries, or
sets of these. A signature is a matrix times the successors' blocks, with sums in the place of the
column bits. What was computed stays known from round to round, as long as blocks keep their
numbers.
"""

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

from time import process_time

import cython
import numpy as np

from symcheck.kernels.tables.hash_mix cimport mix_pair
from symcheck.kernels.tables.pair_map cimport (PairMap, pair_key, pair_map_clear, pair_map_find,
                                               pair_map_insert)
from symcheck.kernels.tables.signature_table cimport SignatureTable
from symcheck.kernels.memory cimport Buffer, release, reserve

__all__ = ["Partition", "largest_sum"]

cdef extern from "Python.h":
    int PyErr_CheckSignals() noexcept

cdef enum:
    NOTHING = -1                 # the leaf 0: no state, the empty bag

cdef enum Stop:
    GOES_ON, NO_MEMORY, SIGNAL, LATE

# Nodes that are kept before those that are no longer needed are dropped; then as many times what is
# left.
cdef enum:
    FIRST_COLLECTION = 4000000
    GROWTH = 4


cdef int pending() except -1:
    return -1


def largest_sum(const int[::1] level, const int[::1] low, const int[::1] high,
                const double[::1] weight, const int[::1] roots):
    """A number that no row of the matrices has a larger sum than (see Partition for the arrays)."""
    bounds = np.zeros(level.shape[0], dtype=np.float64)
    cdef double[::1] bound = bounds
    cdef double a, b, most = 0.0
    cdef Py_ssize_t i
    for i in range(level.shape[0]):
        if i < weight.shape[0]:
            bound[i] = weight[i]
            continue
        a = bound[low[i]] * 2.0 ** free_columns(level[i], level[low[i]])
        b = bound[high[i]] * 2.0 ** free_columns(level[i], level[high[i]])
        bound[i] = a + b if level[i] & 1 else max(a, b)
    for i in range(roots.shape[0]):
        most = max(most, bound[roots[i]] * 2.0 ** free_columns(-1, level[roots[i]]))
    return most


cdef inline int free_columns(int above, int below) noexcept nogil:
    """Column levels (odd) between two levels."""
    return below // 2 - (above + 1) // 2


include "_nodes.pxi"
include "_signatures.pxi"
include "_splitting.pxi"


@cython.final
cdef class Partition(Splitting):
    """A set of states, split further and further.

    bits: of a state. level, low, high, weight, roots: the matrices as an exported diagram; leaves
    first, with `weight`; the level of a node is twice the number of its bit, plus one for a column
    bit; leaves have level 2 bits. choices: whether the matrices are the choices of a state, of
    which it has a set, or the only one. exponent: the lowest binary digit of weights, negated; sums
    must stay below 2 ** (126 - exponent). limit: bytes that may be used. deadline: of processor
    time.

    Methods raise MemoryError at the limit and TimeoutError after the deadline, and then the
    partition is of no use.
    """

    cdef public long long threshold
    cdef readonly long long rounds
    cdef list rewards            # per root: the diagram of what else its rows are told apart by

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
        self.deadline = INFINITY
        self.threshold = FIRST_COLLECTION
        self.signatures = SignatureTable(exponent)
        self.rewards = [NOTHING] * roots.shape[0]
        self.root = NOTHING
        self.mask = 1023
        self.table = <int32_t*>malloc(1024 * sizeof(int32_t))
        if self.table == NULL or reserve(&self.known, 1024) or reserve(&self.seen, 1024):
            raise MemoryError
        memset(self.table, 0xFF, 1024 * sizeof(int32_t))
        memset(self.seen.data, 0, self.seen.size)

    def __dealloc__(self):
        free(self.table)
        release(&self.places)
        release(&self.lows)
        release(&self.highs)
        release(&self.part_block)
        release(&self.part_signature)
        release(&self.part_number)
        release(&self.known)
        release(&self.seen)
        release(&self.quiet)
        release(&self.visits)
        self.forget()

    cdef void forget(self) noexcept nogil:
        pair_map_clear(&self.images)
        pair_map_clear(&self.sums)
        pair_map_clear(&self.unions)
        pair_map_clear(&self.scales)
        pair_map_clear(&self.settled)
        pair_map_clear(&self.surveyed)
        pair_map_clear(&self.found)
        pair_map_clear(&self.renamed)

    @property
    def memory(self):
        """Bytes in use."""
        return self.used()

    @property
    def size(self):
        """Nodes and bags that are kept."""
        return self.nodes + self.signatures.count

    cdef int64_t used(self) noexcept nogil:
        cdef int64_t entries = (self.images.capacity + self.sums.capacity + self.unions.capacity
                                + self.scales.capacity + self.settled.capacity
                                + self.surveyed.capacity + self.found.capacity
                                + self.renamed.capacity)
        return 16 * entries + self.signatures.nbytes() + Nodes.used(self)

    # ---------------------------------------------------------------------------------------- from
    # outside

    cdef int brought(self, const int[::1] level, const int[::1] low, const int[::1] high,
                     const int[::1] leaves, int root) except? -2:
        """An exported diagram over row bits, with its nodes' bits as levels, and its leaves'
        numbers.
        """
        cdef Py_ssize_t i, n = level.shape[0]
        node = np.empty(n, dtype=np.int32)
        cdef int[::1] view = node
        for i in range(leaves.shape[0]):
            view[i] = -1 - leaves[i]
        for i in range(leaves.shape[0], n):
            view[i] = self.make(level[i], view[low[i]], view[high[i]])
        self.ended()
        return view[root]

    def start(self, level, low, high, leaves, int root):
        """Begin with a set of states (leaves 0 and 1) as the only block."""
        self.root = self.brought(level, low, high, leaves, root)
        self.blocks = self.root != NOTHING
        self.rounds = 0
        (<int32_t*>self.known.data)[0] = -1
        (<int32_t*>self.known.data)[1] = -1

    def colour(self, level, low, high, leaves, int root):
        """Keep states apart at which a function of the row bits differs (its leaves are numbered
        from 0 on).
        """
        self.divide(self.brought(level, low, high, leaves, root), False)
        self.unknow()

    def tell_apart(self, int choice, int structure, level, low, high, const double[::1] values,
                   int root):
        """Rows of a matrix are alike only where this function (a reward) is the same."""
        cdef Py_ssize_t i
        vectors = np.zeros(values.shape[0], dtype=np.int32)
        for i in range(values.shape[0]):
            if values[i] != 0.0:
                vectors[i] = self.signatures.singleton(-1 - structure, values[i])
                if vectors[i] < 0:
                    raise MemoryError
        cdef int s = self.brought(level, low, high, vectors, root), r = self.rewards[choice]
        r = self.sum(r, s)
        self.ended()
        self.rewards[choice] = r

    def step(self):
        """Split by where the rows lead; whether that made new blocks."""
        cdef int64_t before = self.blocks
        cdef Py_ssize_t i
        cdef int s, all = NOTHING, reward
        if process_time() > self.deadline:
            raise TimeoutError
        if self.nodes > self.threshold:
            self.collect()
        for i in range(self.roots.shape[0]):
            reward = self.rewards[i]
            with nogil:
                s = self.sum(self.image(self.roots[i], self.root), reward)
                if self.choices:
                    all = self.united(all, s)
                else:
                    all = s
            self.ended()
        self.divide(all, True)
        self.rounds += 1
        return self.blocks > before

    cdef void unknow(self):
        cdef int64_t b
        pair_map_clear(&self.settled)
        for b in range(self.blocks + 1):
            (<int32_t*>self.known.data)[b] = -1

    cdef int copied(self, SignatureTable old, int32_t* places, int32_t* lows, int32_t* highs,
                    int x, bint of_bags) noexcept nogil:
        """A node of the arrays that are being left behind, in the new ones."""
        cdef int r, low, high
        if x == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if x < 0:
            return self.leaf(self.signatures.import_vector(old, -1 - x)) if of_bags else x
        if pair_map_find(&self.renamed, x, 0, &r):
            return r
        low = self.copied(old, places, lows, highs, lows[x], of_bags)
        high = self.copied(old, places, lows, highs, highs[x], of_bags)
        return self.keep(&self.renamed, x, 0, self.make(places[x], low, high))

    cdef int collect(self) except -1:
        """Drop all but the partition and the rewards, and what is known with it."""
        cdef Buffer places = self.places, lows = self.lows, highs = self.highs
        cdef SignatureTable old = self.signatures
        cdef int r
        cdef Buffer none
        none.data = NULL
        none.size = 0
        self.forget()
        self.places = none
        self.lows = none
        self.highs = none
        self.nodes = 0
        self.signatures = SignatureTable(old.exponent)
        memset(self.table, 0xFF, (self.mask + 1) * sizeof(int32_t))
        self.root = self.copied(old, <int32_t*>places.data, <int32_t*>lows.data,
                                <int32_t*>highs.data, self.root, False)
        pair_map_clear(&self.renamed)
        for i in range(len(self.rewards)):
            r = self.rewards[i]
            self.rewards[i] = self.copied(old, <int32_t*>places.data, <int32_t*>lows.data,
                                          <int32_t*>highs.data, r, True)
        pair_map_clear(&self.renamed)
        release(&places)
        release(&lows)
        release(&highs)
        self.unknow()
        self.threshold = max(self.threshold, GROWTH * self.nodes)
        return self.ended()

    def meeting(self, level, low, high, leaves, int root):
        """The blocks that meet a set (leaves 0 and 1), ascending; int64."""
        cdef int64_t i
        cdef int x = self.brought(level, low, high, leaves, root)
        self.rounding = False
        self.parts = 0
        pair_map_clear(&self.surveyed)
        pair_map_clear(&self.found)
        self.meet(self.root, x)
        self.ended()
        blocks = [(<int32_t*>self.part_block.data)[i] for i in range(self.parts)]
        return np.array(sorted(blocks), dtype=np.int64)

    cdef void meet(self, int p, int s) noexcept nogil:
        """Blocks with a state in a set, as parts."""
        cdef int r, place, p0, p1, s0, s1
        if (p == NOTHING or s == NOTHING or self.stop != GOES_ON
                or pair_map_find(&self.surveyed, p, s, &r)):
            return
        self.keep(&self.surveyed, p, s, 0)
        if p < 0 and s < 0:
            if reserve(&self.part_block, 4 * (self.parts + 1)):
                self.fail()
                return
            (<int32_t*>self.part_block.data)[self.parts] = -1 - p
            self.parts += 1
            return
        place = min(self.place_of(p), self.place_of(s))
        self.split(p, place, &p0, &p1)
        self.split(s, place, &s0, &s1)
        self.meet(p0, s0)
        self.meet(p1, s1)

    # ---------------------------------------------------------------------------------------- the
    # blocks

    def first_members(self):
        """(order, members): the blocks by their first members, int64[blocks], and the bits of
        these, uint8[blocks, bits].
        """
        order = np.zeros(self.blocks, dtype=np.int64)
        members = np.zeros((self.blocks, max(1, self.bits)), dtype=np.uint8)
        visited = np.zeros(self.nodes + 1, dtype=np.uint8)
        seen = np.zeros(self.blocks + 1, dtype=np.uint8)
        path = np.zeros(max(1, self.bits), dtype=np.uint8)
        cdef int64_t n = 0
        self.walk(self.root, visited, seen, path, order, members, &n)
        return order, members[:, : self.bits]

    cdef int walk(self, int x, unsigned char[::1] visited, unsigned char[::1] seen,
                  unsigned char[::1] path, long long[::1] order, unsigned char[:, ::1] members,
                  int64_t* n) except -1:
        cdef int place
        if x == NOTHING:
            return 0
        if x < 0:
            if not seen[-1 - x]:
                seen[-1 - x] = 1
                order[n[0]] = -1 - x
                members[n[0], :] = path
                n[0] += 1
            return 0
        if visited[x]:
            return 0
        visited[x] = 1
        place = (<int32_t*>self.places.data)[x]
        self.walk((<int32_t*>self.lows.data)[x], visited, seen, path, order, members, n)
        path[place] = 1
        self.walk((<int32_t*>self.highs.data)[x], visited, seen, path, order, members, n)
        path[place] = 0
        return 0

    def diagram(self):
        """(place, low, high, root) of the partition: ids up to `blocks` are the leaves, then nodes,
        children first.
        """
        cdef int64_t count = 0, i, base = self.blocks + 1
        number = np.full(self.nodes + 1, -1, dtype=np.int64)
        cdef long long[::1] view = number
        self.enumerate(self.root, view, &count)
        cdef int n = <int>(base + count)
        place = np.full(n, self.bits, dtype=np.int32)
        low = np.arange(n, dtype=np.int32)
        high = np.arange(n, dtype=np.int32)
        cdef int[::1] places = place, lows = low, highs = high
        for i in range(self.nodes):
            if view[i] >= 0:
                places[base + view[i]] = (<int32_t*>self.places.data)[i]
                lows[base + view[i]] = self.exported((<int32_t*>self.lows.data)[i], view, base)
                highs[base + view[i]] = self.exported((<int32_t*>self.highs.data)[i], view, base)
        return place, low, high, self.exported(self.root, view, base)

    cdef int exported(self, int x, long long[::1] number, int64_t base):
        return -1 - x if x < 0 else <int>(base + number[x])

    cdef int enumerate(self, int x, long long[::1] number, int64_t* count) except -1:
        if x < 0 or number[x] >= 0:
            return 0
        self.enumerate((<int32_t*>self.lows.data)[x], number, count)
        self.enumerate((<int32_t*>self.highs.data)[x], number, count)
        number[x] = count[0]
        count[0] += 1
        return 0

    def rows(self, const long long[::1] order):
        """The signatures of blocks after a step that split nothing, as compressed rows.

        (groups, indptr, keys, values): int64[n+1], int64[rows+1], int32, float64. A key is a block,
        or -1 - structure for a reward.
        """
        cdef Py_ssize_t i, j, n = order.shape[0], rows = 0, entries = 0
        cdef int s, row
        cdef int64_t k
        groups = np.zeros(n + 1, dtype=np.int64)
        cdef long long[::1] group = groups
        for i in range(n):
            s = (<int32_t*>self.known.data)[order[i]]
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
        """A row of a block, as it was before it was rounded."""
        cdef int s = (<int32_t*>self.known.data)[block]
        return self.signatures.unrounded(self.signatures.keys_of(s)[which] if self.choices else s)
