# Splitting of blocks by the values of a function at their states.

cdef struct Split:              # of this round
    int32_t block, signature
    int32_t number              # of the new block

cdef struct Block:
    int32_t signature
    int32_t last_seen           # the round in which a state with this signature was seen


cdef class Splitting(Signatures):
    """The blocks and how they are split; see Partition."""

    cdef bint choices
    # pairs (partition node, signature node): stable ones; those visited in this round; the numbers
    # of splits; the nodes of the new partition
    cdef PairMap stable, visited_pairs, split_numbers, new_nodes
    cdef Buffer split_storage, block_storage
    cdef Buffer stable_nodes, visit_round
    cdef int64_t splits, stable_count
    cdef int round_number
    cdef bint rounding
    cdef readonly long long blocks
    cdef int root

    @cython.final
    cdef inline Split* split(self, int64_t i) noexcept nogil:
        """A split of this round."""
        return <Split*>self.split_storage.data + i

    @cython.final
    cdef inline Block* block(self, int64_t b) noexcept nogil:
        """What is known about a block."""
        return <Block*>self.block_storage.data + b

    @cython.final
    cdef int add_split(self, int block, int signature) noexcept nogil:
        """Append a split; 1 when memory ends."""
        if reserve(&self.split_storage, (self.splits + 1) * sizeof(Split)):
            self.fail()
            return 1
        self.split(self.splits)[0] = Split(block, signature, -1)
        self.splits += 1
        return 0

    @cython.final
    cdef int signature(self, int s) noexcept nogil:
        """The signature that a leaf is compared by; -1 when memory ends."""
        return self.signatures.round_values(-1 - s) if self.rounding else -1 - s

    @cython.final
    cdef bint collect_splits(self, int p, int s) noexcept nogil:
        """Find the splits that a function makes; whether the signature of a state has changed.

        A block and its known signature are no split. A pair of nodes all of whose leaves are such
        is stable, for good: a changed signature contains a younger block, so the old one does not
        return; and as long as a state has the known signature of its block, the block keeps its
        number.
        """
        cdef int r, bit, p0, p1, s0, s1
        cdef bint changed
        if p == EMPTY or self.stop != RUNNING:
            return False
        if p < 0 and s < 0:
            s = self.signature(s)
            if s < 0:
                self.fail()
            elif self.block(-1 - p).signature == s:
                self.block(-1 - p).last_seen = self.round_number
                return False
            elif not pair_map_find(&self.split_numbers, p, s, &r):
                self.memoise(&self.split_numbers, p, s, <int>self.splits)
                self.add_split(-1 - p, s)
            return True
        if pair_map_find(&self.stable, p, s, &r):
            if reserve(&self.stable_nodes, 4 * (self.stable_count + 1)):
                self.fail()
                return True
            (<int32_t*>self.stable_nodes.data)[self.stable_count] = p
            self.stable_count += 1
            return False
        if pair_map_find(&self.visited_pairs, p, s, &r):
            return True
        bit = min(self.bit_of(p), self.bit_of(s))
        self.children(p, bit, &p0, &p1)
        self.children(s, bit, &s0, &s1)
        changed = self.collect_splits(p0, s0)
        changed |= self.collect_splits(p1, s1)
        if self.tick():
            return True
        self.memoise(&self.visited_pairs if changed else &self.stable, p, s, p)
        return changed

    @cython.final
    cdef int split_blocks(self, int p, int s) noexcept nogil:
        """The new partition, after the splits have got their numbers."""
        cdef int r, bit, p0, p1, s0, s1
        if p == EMPTY or self.stop != RUNNING:
            return EMPTY
        if p < 0 and s < 0:
            r = -1
            if pair_map_find(&self.split_numbers, p, self.signature(s), &r):
                return -1 - self.split(r).number
            return p
        if pair_map_find(&self.stable, p, s, &r) or pair_map_find(&self.new_nodes, p, s, &r):
            return r
        bit = min(self.bit_of(p), self.bit_of(s))
        self.children(p, bit, &p0, &p1)
        self.children(s, bit, &s0, &s1)
        p0 = self.split_blocks(p0, s0)
        p1 = self.split_blocks(p1, s1)
        r = self.memoise(&self.new_nodes, p, s, self.make(bit, p0, p1))
        if r >= 0 and not pair_map_find(&self.stable, r, s, &p0):
            self.memoise(&self.stable, r, s, r)
        return r

    @cython.final
    cdef void mark_blocks_below(self, int p) noexcept nogil:
        """Mark the blocks below a node as seen."""
        if p < 0:
            self.block(-1 - p).last_seen = self.round_number
        elif (<int32_t*>self.visit_round.data)[p] != self.round_number:
            (<int32_t*>self.visit_round.data)[p] = self.round_number
            self.mark_blocks_below(self.node(p).low)
            self.mark_blocks_below(self.node(p).high)

    @cython.final
    cdef int mark_stable_blocks(self) noexcept nogil:
        """Mark the blocks below stable nodes as seen, if a split depends on it; -1 when memory
        ends.
        """
        cdef int64_t i
        cdef bint unknown_blocks = False
        for i in range(self.splits):
            unknown_blocks |= self.block(self.split(i).block).last_seen != self.round_number
        if not unknown_blocks:
            return 0
        i = self.visit_round.size
        if reserve(&self.visit_round, 4 * (self.nodes + 1)):
            return -1
        memset(<char*>self.visit_round.data + i, 0, self.visit_round.size - i)
        for i in range(self.stable_count):
            self.mark_blocks_below((<int32_t*>self.stable_nodes.data)[i])
        return 0

    @cython.final
    cdef int number_splits(self) noexcept nogil:
        """Number the new blocks; -1 when memory ends.

        If no state of a block has the known signature, the first split keeps the number of the
        block.
        """
        cdef int64_t i, b, last_block = self.blocks
        if reserve(&self.block_storage, (self.blocks + self.splits + 2) * sizeof(Block)):
            return -1
        for i in range(self.splits):
            b = self.split(i).block
            if self.block(b).last_seen == self.round_number:
                last_block += 1
                b = last_block
            self.split(i).number = <int>b
            self.block(b)[0] = Block(self.split(i).signature, self.round_number)
        self.blocks = last_block
        return 0

    @cython.final
    cdef int refine(self, int s, bint signatures) except -1:
        """Split the blocks by a function, whose value at each block is known afterwards."""
        cdef int64_t blocks_before = self.blocks
        cdef int x
        self.rounding = signatures and not self.choices
        self.splits = 0
        self.stable_count = 0
        self.round_number += 1
        pair_map_clear(&self.visited_pairs)
        pair_map_clear(&self.split_numbers)
        pair_map_clear(&self.new_nodes)
        with nogil:
            self.collect_splits(self.root, s)
            if self.stop == RUNNING and (self.mark_stable_blocks() < 0 or self.number_splits() < 0):
                self.fail()
            if self.stop == RUNNING and self.splits:
                x = self.split_blocks(self.root, s)
                if self.stop == RUNNING:
                    self.root = x
        return self.raise_if_stopped()
