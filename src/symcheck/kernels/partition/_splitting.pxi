# Blocks split by what a function is at their states.

cdef class Splitting(Signatures):
    """The blocks, and how they are split; see Partition."""

    cdef bint choices
    # of partition and signature: all leaves as known of the blocks; in this round: looked at;
    # parts; the new partition
    cdef PairMap settled, surveyed, found, renamed
    # of this round: the parts, each a block and a signature, and then a number; nodes of the
    # partition that are settled
    cdef Buffer part_block, part_signature, part_number, quiet, visits
    cdef int64_t parts, quiets
    # blocks: the signature of each, and the round when it was last seen
    cdef Buffer known, seen
    cdef int now
    cdef bint rounding
    cdef readonly long long blocks
    cdef int root

    @cython.final
    cdef int signature(self, int s) noexcept nogil:
        """What a leaf of a signature is compared by; -1: no memory."""
        return self.signatures.round_values(-1 - s) if self.rounding else -1 - s

    @cython.final
    cdef bint survey(self, int p, int s) noexcept nogil:
        """Find the parts that a function makes of the blocks; whether there is a state whose
        signature has changed.

        A block and a signature that are known to belong together are no part. A pair of nodes whose
        leaves all are so is settled, for good: a signature that has changed names a block that is
        younger, and so does not come back; while a state has the signature that is known of its
        block, the number stays with that.
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
            elif not pair_map_find(&self.found, p, s, &r):
                if (reserve(&self.part_block, 4 * (self.parts + 1))
                        or reserve(&self.part_signature, 4 * (self.parts + 1))):
                    self.fail()
                    return True
                (<int32_t*>self.part_block.data)[self.parts] = -1 - p
                (<int32_t*>self.part_signature.data)[self.parts] = s
                self.keep(&self.found, p, s, <int>self.parts)
                self.parts += 1
            return True
        if pair_map_find(&self.settled, p, s, &r):
            if reserve(&self.quiet, 4 * (self.quiets + 1)):
                self.fail()
                return True
            (<int32_t*>self.quiet.data)[self.quiets] = p
            self.quiets += 1
            return False
        if pair_map_find(&self.surveyed, p, s, &r):
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

    @cython.final
    cdef int divided(self, int p, int s) noexcept nogil:
        """The new partition, after the parts have got their numbers."""
        cdef int r, place, p0, p1, s0, s1
        if p == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if p < 0 and s < 0:
            r = -1
            if pair_map_find(&self.found, p, self.signature(s), &r):
                return -1 - (<int32_t*>self.part_number.data)[r]
            return p
        if pair_map_find(&self.settled, p, s, &r) or pair_map_find(&self.renamed, p, s, &r):
            return r
        place = min(self.place_of(p), self.place_of(s))
        self.split(p, place, &p0, &p1)
        self.split(s, place, &s0, &s1)
        p0 = self.divided(p0, s0)
        p1 = self.divided(p1, s1)
        r = self.keep(&self.renamed, p, s, self.make(place, p0, p1))
        if r >= 0 and not pair_map_find(&self.settled, r, s, &p0):
            self.keep(&self.settled, r, s, r)
        return r

    @cython.final
    cdef void look_around(self, int p) noexcept nogil:
        """See which blocks there are below a node."""
        if p < 0:
            (<int32_t*>self.seen.data)[-1 - p] = self.now
        elif (<int32_t*>self.visits.data)[p] != self.now:
            (<int32_t*>self.visits.data)[p] = self.now
            self.look_around((<int32_t*>self.lows.data)[p])
            self.look_around((<int32_t*>self.highs.data)[p])

    @cython.final
    cdef int look_where_quiet(self) noexcept nogil:
        """See the blocks of what is settled, if it matters for some part whether its block is
        there.
        """
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

    @cython.final
    cdef int number_parts(self) noexcept nogil:
        """New numbers for parts; where none of a block has the signature that was known of it, the
        first keeps its number.
        """
        cdef int64_t i, fresh = self.blocks
        cdef int b
        if (reserve(&self.part_number, 4 * (self.parts + 1))
                or reserve(&self.known, 4 * (self.blocks + self.parts + 2))
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

    @cython.final
    cdef int divide(self, int s, bint signatures) except -1:
        """Split the blocks by a function; what it is at each block is known afterwards."""
        cdef int64_t before = self.blocks
        cdef int x
        self.rounding = signatures and not self.choices
        self.parts = 0
        self.quiets = 0
        self.now += 1
        pair_map_clear(&self.surveyed)
        pair_map_clear(&self.found)
        pair_map_clear(&self.renamed)
        with nogil:
            self.survey(self.root, s)
            if self.stop == GOES_ON and (self.look_where_quiet() < 0 or self.number_parts() < 0):
                self.fail()
            if self.stop == GOES_ON and self.parts:
                x = self.divided(self.root, s)
                if self.stop == GOES_ON:
                    self.root = x
        return self.ended()
