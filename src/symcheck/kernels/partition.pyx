# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Partition refinement on diagrams: the states of a huge set are never listed, their blocks are the leaves of a diagram.

Nodes are kept once, in arrays of this module's own. A node has a place (the number of a row bit) and two children; a child
that is negative is the leaf -1 - child. In a partition leaves are blocks, 0 being no state; in a signature they are bags
(see bags.pyx) from blocks to sums of entries, or sets of these. A signature is a matrix times the successors' blocks, with
sums in the place of the column bits. What was computed stays known from round to round, as long as blocks keep their numbers.
"""

from libc.stdint cimport int32_t, int64_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memset

import cython
import numpy as np

from symcheck.kernels._pairs cimport Pairs, pair_hash, pair_key, pairs_drop, pairs_find, pairs_put
from symcheck.kernels.bags cimport Bags
from symcheck.kernels.memory cimport Buffer, release, reserve

__all__ = ["Partition", "largest_sum"]

cdef extern from "Python.h":
    int PyErr_CheckSignals() noexcept

cdef enum:
    NOTHING = -1                 # the leaf 0: no state, the empty bag

cdef enum Stop:
    GOES_ON, NO_MEMORY, SIGNAL

# Nodes that are kept before those that are no longer needed are dropped; then as many times what is left.
DEF FIRST_COLLECTION = 4000000
DEF GROWTH = 4


cdef int pending() except -1:
    return -1


def largest_sum(const int[::1] level, const int[::1] low, const int[::1] high, const double[::1] weight, const int[::1] roots):
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


@cython.final
cdef class Partition:
    """A set of states, split further and further.

    bits: of a state. level, low, high, weight, roots: the matrices as an exported diagram; leaves first, with `weight`; the
    level of a node is twice the number of its bit, plus one for a column bit; leaves have level 2 bits. choices: whether the
    matrices are the choices of a state, of which it has a set, or the only one. exponent: the lowest binary digit of weights,
    negated; sums must stay below 2 ** (126 - exponent). limit: bytes that may be used.
    """

    cdef int bits, leaves
    cdef bint choices
    cdef const int[::1] level, low, high, roots
    cdef const double[::1] weight
    cdef int64_t limit, threshold
    cdef Stop stop
    cdef uint64_t ticks
    cdef Bags bags
    # nodes
    cdef Buffer places, lows, highs
    cdef int32_t* table
    cdef int64_t mask, nodes
    # what is known: matrix node and partition to signature; two signatures to their sum; set and signature to set; …
    cdef Pairs images, sums, unions, scales
    # of partition and signature: all leaves as known of the blocks; in this round: looked at; parts; the new partition
    cdef Pairs settled, surveyed, found, renamed
    # of this round: the parts, each a block and a signature, and then a number; nodes of the partition that are settled
    cdef Buffer part_block, part_signature, part_number, quiet, visits
    cdef int64_t parts, quiets
    # blocks: the signature of each, and the round when it was last seen
    cdef Buffer known, seen
    cdef int now
    cdef bint rounding
    cdef readonly long long blocks
    cdef readonly long long rounds
    cdef int root
    cdef list rewards            # per root: the diagram of what else its rows are told apart by

    def __cinit__(self, int bits, const int[::1] level, const int[::1] low, const int[::1] high, const double[::1] weight,
                  const int[::1] roots, bint choices, int exponent, long long limit):
        self.bits = bits
        self.level = level
        self.low = low
        self.high = high
        self.weight = weight
        self.leaves = <int>weight.shape[0]
        self.roots = roots
        self.choices = choices
        self.limit = limit
        self.threshold = FIRST_COLLECTION
        self.bags = Bags(exponent)
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
        pairs_drop(&self.images)
        pairs_drop(&self.sums)
        pairs_drop(&self.unions)
        pairs_drop(&self.scales)
        pairs_drop(&self.settled)
        pairs_drop(&self.surveyed)
        pairs_drop(&self.found)
        pairs_drop(&self.renamed)

    @property
    def memory(self):
        """Bytes in use."""
        return self.used()

    @property
    def size(self):
        """Nodes and bags that are kept."""
        return self.nodes + self.bags.count

    cdef int64_t used(self) noexcept nogil:
        cdef int64_t entries = (self.images.size + self.sums.size + self.unions.size + self.scales.size + self.settled.size
                                + self.surveyed.size + self.found.size + self.renamed.size)
        return 16 * entries + self.bags.memory() + self.places.size + self.lows.size + self.highs.size + 4 * (self.mask + 1)

    # ---------------------------------------------------------------------------------------- nodes

    cdef inline int fail(self) noexcept nogil:
        if self.stop == GOES_ON:
            self.stop = NO_MEMORY
        return NOTHING

    cdef inline int place_of(self, int x) noexcept nogil:
        return self.bits if x < 0 else (<int32_t*>self.places.data)[x]

    cdef inline void split(self, int x, int place, int* low, int* high) noexcept nogil:
        if x >= 0 and (<int32_t*>self.places.data)[x] == place:
            low[0] = (<int32_t*>self.lows.data)[x]
            high[0] = (<int32_t*>self.highs.data)[x]
        else:
            low[0] = x
            high[0] = x

    cdef inline bint tick(self) noexcept nogil:
        self.ticks += 1
        return (self.ticks & 0xFFFF) == 0 and self.look_up()

    cdef bint look_up(self) noexcept nogil:
        """Whether to stop: memory or a signal."""
        if self.used() > self.limit:
            self.fail()
        else:
            with gil:
                if PyErr_CheckSignals() != 0:
                    self.stop = SIGNAL
        return self.stop != GOES_ON

    cdef int make(self, int place, int low, int high) noexcept nogil:
        """The node with these children."""
        cdef int64_t at
        cdef int x
        if low == high or self.stop != GOES_ON:
            return low
        if self.tick():
            return NOTHING
        at = <int64_t>pair_hash(pair_key(low, high) ^ (<uint64_t>(place + 1) * <uint64_t>0x9E3779B97F4A7C15)) & self.mask
        while self.table[at] >= 0:
            x = self.table[at]
            if ((<int32_t*>self.lows.data)[x] == low and (<int32_t*>self.highs.data)[x] == high
                    and (<int32_t*>self.places.data)[x] == place):
                return x
            at = (at + 1) & self.mask
        if (self.nodes >= 0x7FFFFFF0 or reserve(&self.places, 4 * (self.nodes + 1)) or reserve(&self.lows, 4 * (self.nodes + 1))
                or reserve(&self.highs, 4 * (self.nodes + 1))):
            return self.fail()
        x = <int>self.nodes
        (<int32_t*>self.places.data)[x] = place
        (<int32_t*>self.lows.data)[x] = low
        (<int32_t*>self.highs.data)[x] = high
        self.table[at] = x
        self.nodes += 1
        if 2 * self.nodes > self.mask and self.rehash() < 0:
            return self.fail()
        return x

    cdef int rehash(self) noexcept nogil:
        cdef int64_t mask = 2 * self.mask + 1, at, x
        cdef int32_t* table = <int32_t*>malloc((mask + 1) * sizeof(int32_t))
        if table == NULL:
            return -1
        memset(table, 0xFF, (mask + 1) * sizeof(int32_t))
        for x in range(self.nodes):
            at = <int64_t>pair_hash(pair_key((<int32_t*>self.lows.data)[x], (<int32_t*>self.highs.data)[x])
                                    ^ (<uint64_t>((<int32_t*>self.places.data)[x] + 1) * <uint64_t>0x9E3779B97F4A7C15)) & mask
            while table[at] >= 0:
                at = (at + 1) & mask
            table[at] = <int32_t>x
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    cdef inline int keep(self, Pairs* memo, int a, int b, int result) noexcept nogil:
        if self.stop == GOES_ON and pairs_put(memo, a, b, result) < 0:
            return self.fail()
        return result

    cdef inline int leaf(self, int bag) noexcept nogil:
        return self.fail() if bag < 0 else -1 - bag

    # ---------------------------------------------------------------------------------------- signatures

    cdef int image(self, int m, int p) noexcept nogil:
        """Where the rows of a matrix lead: the sum over the column bits, from the topmost of the two nodes on, of its entries."""
        cdef int r, place, m0, m1, m00, m01, m10, m11, p0, p1
        if p == NOTHING or self.stop != GOES_ON or (m < self.leaves and self.weight[m] == 0.0):
            return NOTHING
        if m < self.leaves and p < 0:
            return self.leaf(self.bags.one(-1 - p, self.weight[m]))
        if pairs_find(&self.images, m, p, &r):
            return r
        place = min(self.level[m] >> 1, self.place_of(p))
        self.halves(m, 2 * place, &m0, &m1)
        self.halves(m0, 2 * place + 1, &m00, &m01)
        self.halves(m1, 2 * place + 1, &m10, &m11)
        self.split(p, place, &p0, &p1)
        m0 = self.sum(self.below(m00, p0, place), self.below(m01, p1, place))
        m1 = self.sum(self.below(m10, p0, place), self.below(m11, p1, place))
        return self.keep(&self.images, m, p, self.make(place, m0, m1))

    cdef inline void halves(self, int m, int level, int* low, int* high) noexcept nogil:
        if self.level[m] == level:
            low[0] = self.low[m]
            high[0] = self.high[m]
        else:
            low[0] = m
            high[0] = m

    cdef inline int below(self, int m, int p, int place) noexcept nogil:
        """The image from the bit after `place` on: column bits that neither node asks for count twice each."""
        cdef int r = self.image(m, p)
        cdef int gap = min(self.level[m] >> 1, self.place_of(p)) - place - 1
        return r if gap == 0 or r == NOTHING else self.scale(r, gap)

    cdef int scale(self, int a, int doublings) noexcept nogil:
        cdef int r, low, high
        if a == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if pairs_find(&self.scales, a, doublings, &r):
            return r
        if a < 0:
            r = self.leaf(self.bags.scaled(-1 - a, doublings))
        else:
            low = self.scale((<int32_t*>self.lows.data)[a], doublings)
            high = self.scale((<int32_t*>self.highs.data)[a], doublings)
            r = self.make((<int32_t*>self.places.data)[a], low, high)
        return self.keep(&self.scales, a, doublings, r)

    cdef int sum(self, int a, int b) noexcept nogil:
        """Two signatures added."""
        cdef int r, place, a0, a1, b0, b1
        if a == NOTHING:
            return b
        if b == NOTHING:
            return a
        if self.stop != GOES_ON:
            return NOTHING
        if a > b:
            a, b = b, a
        if pairs_find(&self.sums, a, b, &r):
            return r
        if b < 0:
            return self.keep(&self.sums, a, b, self.leaf(self.bags.add(-1 - a, -1 - b)))
        place = min(self.place_of(a), self.place_of(b))
        self.split(a, place, &a0, &a1)
        self.split(b, place, &b0, &b1)
        a0 = self.sum(a0, b0)
        a1 = self.sum(a1, b1)
        return self.keep(&self.sums, a, b, self.make(place, a0, a1))

    cdef int united(self, int a, int b) noexcept nogil:
        """Sets of signatures (a) and one more (b)."""
        cdef int r, place, a0, a1, b0, b1
        if b == NOTHING or self.stop != GOES_ON:
            return a
        if pairs_find(&self.unions, a, b, &r):
            return r
        if a < 0 and b < 0:
            place = self.bags.rounded(-1 - b)
            if place < 0:
                return self.fail()
            return self.keep(&self.unions, a, b, self.leaf(self.bags.with_key(-1 - a, place)))
        place = min(self.place_of(a), self.place_of(b))
        self.split(a, place, &a0, &a1)
        self.split(b, place, &b0, &b1)
        a0 = self.united(a0, b0)
        a1 = self.united(a1, b1)
        return self.keep(&self.unions, a, b, self.make(place, a0, a1))

    # ---------------------------------------------------------------------------------------- splitting

    cdef int signature(self, int s) noexcept nogil:
        """What a leaf of a signature is compared by; -1: no memory."""
        return self.bags.rounded(-1 - s) if self.rounding else -1 - s

    cdef bint survey(self, int p, int s) noexcept nogil:
        """Find the parts that a function makes of the blocks; whether there is a state whose signature has changed.

        A block and a signature that are known to belong together are no part. A pair of nodes whose leaves all are so is
        settled, for good: a signature that has changed names a block that is younger, and so does not come back; while a
        state has the signature that is known of its block, the number stays with that.
        """
        cdef int r, place, p0, p1, s0, s1
        cdef bint changed
        if p == NOTHING or self.stop != GOES_ON:
            return False
        if p < 0 and s < 0:
            s = self.signature(s)
            if s < 0:
                self.fail()
            elif (<int32_t*>self.known.data)[-1 - p] == s:
                (<int32_t*>self.seen.data)[-1 - p] = self.now
                return False
            elif not pairs_find(&self.found, p, s, &r):
                if reserve(&self.part_block, 4 * (self.parts + 1)) or reserve(&self.part_signature, 4 * (self.parts + 1)):
                    self.fail()
                    return True
                (<int32_t*>self.part_block.data)[self.parts] = -1 - p
                (<int32_t*>self.part_signature.data)[self.parts] = s
                self.keep(&self.found, p, s, <int>self.parts)
                self.parts += 1
            return True
        if pairs_find(&self.settled, p, s, &r):
            if reserve(&self.quiet, 4 * (self.quiets + 1)):
                self.fail()
                return True
            (<int32_t*>self.quiet.data)[self.quiets] = p
            self.quiets += 1
            return False
        if pairs_find(&self.surveyed, p, s, &r):
            return True
        place = min(self.place_of(p), self.place_of(s))
        self.split(p, place, &p0, &p1)
        self.split(s, place, &s0, &s1)
        changed = self.survey(p0, s0)
        changed |= self.survey(p1, s1)
        if self.tick():
            return True
        self.keep(&self.surveyed if changed else &self.settled, p, s, p)
        return changed

    cdef int divided(self, int p, int s) noexcept nogil:
        """The new partition, after the parts have got their numbers."""
        cdef int r, place, p0, p1, s0, s1
        if p == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if p < 0 and s < 0:
            r = -1
            if pairs_find(&self.found, p, self.signature(s), &r):
                return -1 - (<int32_t*>self.part_number.data)[r]
            return p
        if pairs_find(&self.settled, p, s, &r) or pairs_find(&self.renamed, p, s, &r):
            return r
        place = min(self.place_of(p), self.place_of(s))
        self.split(p, place, &p0, &p1)
        self.split(s, place, &s0, &s1)
        p0 = self.divided(p0, s0)
        p1 = self.divided(p1, s1)
        r = self.keep(&self.renamed, p, s, self.make(place, p0, p1))
        if r >= 0 and not pairs_find(&self.settled, r, s, &p0):
            self.keep(&self.settled, r, s, r)
        return r

    cdef void look_around(self, int p) noexcept nogil:
        """See which blocks there are below a node."""
        if p < 0:
            (<int32_t*>self.seen.data)[-1 - p] = self.now
        elif (<int32_t*>self.visits.data)[p] != self.now:
            (<int32_t*>self.visits.data)[p] = self.now
            self.look_around((<int32_t*>self.lows.data)[p])
            self.look_around((<int32_t*>self.highs.data)[p])

    cdef int look_where_quiet(self) noexcept nogil:
        """See the blocks of what is settled, if it matters for some part whether its block is there."""
        cdef int64_t i
        cdef bint open = False
        for i in range(self.parts):
            open |= (<int32_t*>self.seen.data)[(<int32_t*>self.part_block.data)[i]] != self.now
        if not open:
            return 0
        i = self.visits.size
        if reserve(&self.visits, 4 * (self.nodes + 1)):
            return -1
        memset(<char*>self.visits.data + i, 0, self.visits.size - i)
        for i in range(self.quiets):
            self.look_around((<int32_t*>self.quiet.data)[i])
        return 0

    cdef int number_parts(self) noexcept nogil:
        """New numbers for parts; where none of a block has the signature that was known of it, the first keeps its number."""
        cdef int64_t i, fresh = self.blocks
        cdef int b
        if (reserve(&self.part_number, 4 * (self.parts + 1)) or reserve(&self.known, 4 * (self.blocks + self.parts + 2))
                or reserve(&self.seen, 4 * (self.blocks + self.parts + 2))):
            return -1
        cdef int32_t* seen = <int32_t*>self.seen.data
        for i in range(self.parts):
            b = (<int32_t*>self.part_block.data)[i]
            if seen[b] != self.now:
                seen[b] = self.now
            else:
                fresh += 1
                b = <int>fresh
                seen[b] = self.now
            (<int32_t*>self.part_number.data)[i] = b
            (<int32_t*>self.known.data)[b] = (<int32_t*>self.part_signature.data)[i]
        self.blocks = fresh
        return 0

    cdef int divide(self, int s, bint signatures) except -1:
        """Split the blocks by a function; what it is at each block is known afterwards."""
        cdef int64_t before = self.blocks
        cdef int x
        self.rounding = signatures and not self.choices
        self.parts = 0
        self.quiets = 0
        self.now += 1
        pairs_drop(&self.surveyed)
        pairs_drop(&self.found)
        pairs_drop(&self.renamed)
        with nogil:
            self.survey(self.root, s)
            if self.stop == GOES_ON and (self.look_where_quiet() < 0 or self.number_parts() < 0):
                self.fail()
            if self.stop == GOES_ON and self.parts:
                x = self.divided(self.root, s)
                if self.stop == GOES_ON:
                    self.root = x
        return self.ended()

    cdef int ended(self) except -1:
        cdef Stop stop = self.stop
        self.stop = GOES_ON
        if stop == SIGNAL:
            return pending()
        if stop == NO_MEMORY:
            raise MemoryError
        return 0

    # ---------------------------------------------------------------------------------------- from outside

    cdef int brought(self, const int[::1] level, const int[::1] low, const int[::1] high, const int[::1] leaves, int root) except? -2:
        """An exported diagram over row bits, with its nodes' bits as levels, and its leaves' numbers."""
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
        """Keep states apart at which a function of the row bits differs (its leaves are numbered from 0 on)."""
        self.divide(self.brought(level, low, high, leaves, root), False)
        self.unknow()

    def tell_apart(self, int choice, int structure, level, low, high, const double[::1] values, int root):
        """Rows of a matrix are alike only where this function (a reward) is the same."""
        cdef Py_ssize_t i
        bags = np.zeros(values.shape[0], dtype=np.int32)
        for i in range(values.shape[0]):
            if values[i] != 0.0:
                bags[i] = self.bags.one(-1 - structure, values[i])
                if bags[i] < 0:
                    raise MemoryError
        cdef int s = self.brought(level, low, high, bags, root), r = self.rewards[choice]
        r = self.sum(r, s)
        self.ended()
        self.rewards[choice] = r

    def step(self):
        """Split by where the rows lead; whether that made new blocks."""
        cdef int64_t before = self.blocks
        cdef Py_ssize_t i
        cdef int s, all = NOTHING, reward
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
        pairs_drop(&self.settled)
        for b in range(self.blocks + 1):
            (<int32_t*>self.known.data)[b] = -1

    cdef int copied(self, Bags old, int32_t* places, int32_t* lows, int32_t* highs, int x, bint of_bags) noexcept nogil:
        """A node of the arrays that are being left behind, in the new ones."""
        cdef int r, low, high
        if x == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if x < 0:
            return self.leaf(self.bags.copied(old, -1 - x)) if of_bags else x
        if pairs_find(&self.renamed, x, 0, &r):
            return r
        low = self.copied(old, places, lows, highs, lows[x], of_bags)
        high = self.copied(old, places, lows, highs, highs[x], of_bags)
        return self.keep(&self.renamed, x, 0, self.make(places[x], low, high))

    cdef int collect(self) except -1:
        """Drop all but the partition and the rewards, and what is known with it."""
        cdef Buffer places = self.places, lows = self.lows, highs = self.highs
        cdef Bags old = self.bags
        cdef int r
        cdef Buffer none
        none.data = NULL
        none.size = 0
        self.forget()
        self.places = none
        self.lows = none
        self.highs = none
        self.nodes = 0
        self.bags = Bags(old.exponent)
        memset(self.table, 0xFF, (self.mask + 1) * sizeof(int32_t))
        self.root = self.copied(old, <int32_t*>places.data, <int32_t*>lows.data, <int32_t*>highs.data, self.root, False)
        pairs_drop(&self.renamed)
        for i in range(len(self.rewards)):
            r = self.rewards[i]
            self.rewards[i] = self.copied(old, <int32_t*>places.data, <int32_t*>lows.data, <int32_t*>highs.data, r, True)
        pairs_drop(&self.renamed)
        release(&places)
        release(&lows)
        release(&highs)
        self.unknow()
        self.threshold = max(<int64_t>FIRST_COLLECTION, GROWTH * self.nodes)
        return self.ended()

    def meeting(self, level, low, high, leaves, int root):
        """The blocks that meet a set (leaves 0 and 1), ascending; int64."""
        cdef int64_t i
        cdef int x = self.brought(level, low, high, leaves, root)
        self.rounding = False
        self.parts = 0
        pairs_drop(&self.surveyed)
        pairs_drop(&self.found)
        self.meet(self.root, x)
        self.ended()
        blocks = [(<int32_t*>self.part_block.data)[i] for i in range(self.parts)]
        return np.array(sorted(blocks), dtype=np.int64)

    cdef void meet(self, int p, int s) noexcept nogil:
        """Blocks with a state in a set, as parts."""
        cdef int r, place, p0, p1, s0, s1
        if p == NOTHING or s == NOTHING or self.stop != GOES_ON or pairs_find(&self.surveyed, p, s, &r):
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

    # ---------------------------------------------------------------------------------------- the blocks

    def first_members(self):
        """(order, members): the blocks by their first members, int64[blocks], and the bits of these, uint8[blocks, bits]."""
        order = np.zeros(self.blocks, dtype=np.int64)
        members = np.zeros((self.blocks, max(1, self.bits)), dtype=np.uint8)
        visited = np.zeros(self.nodes + 1, dtype=np.uint8)
        seen = np.zeros(self.blocks + 1, dtype=np.uint8)
        path = np.zeros(max(1, self.bits), dtype=np.uint8)
        cdef int64_t n = 0
        self.walk(self.root, visited, seen, path, order, members, &n)
        return order, members[:, : self.bits]

    cdef int walk(self, int x, unsigned char[::1] visited, unsigned char[::1] seen, unsigned char[::1] path, long long[::1] order,
                  unsigned char[:, ::1] members, int64_t* n) except -1:
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
        """(place, low, high, root) of the partition: ids up to `blocks` are the leaves, then nodes, children first."""
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

        (groups, indptr, keys, values): int64[n+1], int64[rows+1], int32, float64. A key is a block, or -1 - structure for a
        reward.
        """
        cdef Py_ssize_t i, j, n = order.shape[0], rows = 0, entries = 0
        cdef int s, row
        cdef int64_t k
        groups = np.zeros(n + 1, dtype=np.int64)
        cdef long long[::1] group = groups
        for i in range(n):
            s = (<int32_t*>self.known.data)[order[i]]
            group[i + 1] = group[i] + (self.bags.length(s) if self.choices else 1)
        indptr = np.zeros(group[n] + 1, dtype=np.int64)
        cdef long long[::1] starts = indptr
        for i in range(n):
            for j in range(group[i + 1] - group[i]):
                starts[rows + 1] = starts[rows] + self.bags.length(self.row(<int>order[i], j))
                rows += 1
        keys = np.empty(starts[rows], dtype=np.int32)
        values = np.empty(starts[rows], dtype=np.float64)
        cdef int[::1] key = keys
        cdef double[::1] value = values
        for i in range(n):
            for j in range(group[i + 1] - group[i]):
                row = self.row(<int>order[i], j)
                for k in range(self.bags.length(row)):
                    key[entries] = self.bags.keys_of(row)[k]
                    value[entries] = self.bags.value(row, k)
                    entries += 1
        return groups, indptr, keys, values

    cdef int row(self, int block, Py_ssize_t which) noexcept nogil:
        """A row of a block, as it was before it was rounded."""
        cdef int s = (<int32_t*>self.known.data)[block]
        return self.bags.raw_of(self.bags.keys_of(s)[which] if self.choices else s)
