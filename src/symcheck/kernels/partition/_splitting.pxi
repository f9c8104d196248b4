# Splitting of blocks by the values of a function at their states.

cdef class Splitting(Signatures):
    """The blocks and how they are split; see Partition."""

    cdef bint choices
    # pairs (partition node, signature node): stable ones; those visited in this round; the numbers
    # of splits; the nodes of the new partition
    cdef PairMap stable, visited_pairs, split_numbers, new_nodes
    # splits of this round (block, signature, number of the new block); stable partition nodes
    cdef Buffer split_block, split_signature, split_block_number, stable_nodes, visit_round
    cdef int64_t splits, stable_count
    # per block: its signature, and the round in which it was last seen
    cdef Buffer block_signature, last_seen
    cdef int round_number
    cdef bint rounding
    cdef readonly long long blocks
    cdef int root

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
            elif (<int32_t*>self.block_signature.data)[-1 - p] == s:
                (<int32_t*>self.last_seen.data)[-1 - p] = self.round_number
                return False
            elif not pair_map_find(&self.split_numbers, p, s, &r):
                if (reserve(&self.split_block, 4 * (self.splits + 1))
                        or reserve(&self.split_signature, 4 * (self.splits + 1))):
                    self.fail()
                    return True
                (<int32_t*>self.split_block.data)[self.splits] = -1 - p
                (<int32_t*>self.split_signature.data)[self.splits] = s
                self.memoise(&self.split_numbers, p, s, <int>self.splits)
                self.splits += 1
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
                return -1 - (<int32_t*>self.split_block_number.data)[r]
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
            (<int32_t*>self.last_seen.data)[-1 - p] = self.round_number
        elif (<int32_t*>self.visit_round.data)[p] != self.round_number:
            (<int32_t*>self.visit_round.data)[p] = self.round_number
            self.mark_blocks_below((<int32_t*>self.lows.data)[p])
            self.mark_blocks_below((<int32_t*>self.highs.data)[p])

    @cython.final
    cdef int mark_stable_blocks(self) noexcept nogil:
        """Mark the blocks below stable nodes as seen, if a split depends on it; -1 when memory
        ends.
        """
        cdef int64_t i
        cdef bint unknown_blocks = False
        cdef const int32_t* last_seen = <int32_t*>self.last_seen.data
        cdef const int32_t* split_block = <int32_t*>self.split_block.data
        for i in range(self.splits):
            unknown_blocks |= last_seen[split_block[i]] != self.round_number
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
        cdef int64_t i, last_block = self.blocks
        cdef int b
        if (reserve(&self.split_block_number, 4 * (self.splits + 1))
                or reserve(&self.block_signature, 4 * (self.blocks + self.splits + 2))
            or reserve(&self.last_seen, 4 * (self.blocks + self.splits + 2))):
            return -1
        cdef int32_t* last_seen = <int32_t*>self.last_seen.data
        for i in range(self.splits):
            b = (<int32_t*>self.split_block.data)[i]
            if last_seen[b] != self.round_number:
                last_seen[b] = self.round_number
            else:
                last_block += 1
                b = <int>last_block
                last_seen[b] = self.round_number
            (<int32_t*>self.split_block_number.data)[i] = b
            (<int32_t*>self.block_signature.data)[b] = (<int32_t*>self.split_signature.data)[i]
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
