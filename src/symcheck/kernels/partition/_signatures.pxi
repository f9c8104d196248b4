# Signatures: a matrix times the blocks of successors.

cdef class Signatures(Nodes):
    """Matrices and what is computed with them; see Partition."""

    cdef int leaves
    cdef const int[::1] level, low, high, roots
    cdef const double[::1] weight
    cdef SignatureTable signatures
    # what is known: matrix node and partition to signature; two signatures to their sum; set and
    # signature to set; …
    cdef PairMap images, sums, unions, scales

    @cython.final
    cdef int image(self, int m, int p) noexcept nogil:
        """Where the rows of a matrix lead: the sum over the column bits, from the topmost of the
        two nodes on, of its entries.
        """
        cdef int r, place, m0, m1, m00, m01, m10, m11, p0, p1
        if p == NOTHING or self.stop != GOES_ON or (m < self.leaves and self.weight[m] == 0.0):
            return NOTHING
        if m < self.leaves and p < 0:
            return self.leaf(self.signatures.singleton(-1 - p, self.weight[m]))
        if pair_map_find(&self.images, m, p, &r):
            return r
        place = min(self.level[m] >> 1, self.place_of(p))
        self.halves(m, 2 * place, &m0, &m1)
        self.halves(m0, 2 * place + 1, &m00, &m01)
        self.halves(m1, 2 * place + 1, &m10, &m11)
        self.split(p, place, &p0, &p1)
        m0 = self.sum(self.below(m00, p0, place), self.below(m01, p1, place))
        m1 = self.sum(self.below(m10, p0, place), self.below(m11, p1, place))
        return self.keep(&self.images, m, p, self.make(place, m0, m1))

    @cython.final
    cdef inline void halves(self, int m, int level, int* low, int* high) noexcept nogil:
        if self.level[m] == level:
            low[0] = self.low[m]
            high[0] = self.high[m]
        else:
            low[0] = m
            high[0] = m

    @cython.final
    cdef inline int below(self, int m, int p, int place) noexcept nogil:
        """The image from the bit after `place` on: column bits that neither node asks for count
        twice each.
        """
        cdef int r = self.image(m, p)
        cdef int gap = min(self.level[m] >> 1, self.place_of(p)) - place - 1
        return r if gap == 0 or r == NOTHING else self.scale(r, gap)

    @cython.final
    cdef int scale(self, int a, int doublings) noexcept nogil:
        cdef int r, low, high
        if a == NOTHING or self.stop != GOES_ON:
            return NOTHING
        if pair_map_find(&self.scales, a, doublings, &r):
            return r
        if a < 0:
            r = self.leaf(self.signatures.shift_left(-1 - a, doublings))
        else:
            low = self.scale((<int32_t*>self.lows.data)[a], doublings)
            high = self.scale((<int32_t*>self.highs.data)[a], doublings)
            r = self.make((<int32_t*>self.places.data)[a], low, high)
        return self.keep(&self.scales, a, doublings, r)

    @cython.final
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
        if pair_map_find(&self.sums, a, b, &r):
            return r
        if b < 0:
            return self.keep(&self.sums, a, b, self.leaf(self.signatures.add(-1 - a, -1 - b)))
        place = min(self.place_of(a), self.place_of(b))
        self.split(a, place, &a0, &a1)
        self.split(b, place, &b0, &b1)
        a0 = self.sum(a0, b0)
        a1 = self.sum(a1, b1)
        return self.keep(&self.sums, a, b, self.make(place, a0, a1))

    @cython.final
    cdef int united(self, int a, int b) noexcept nogil:
        """Sets of signatures (a) and one more (b)."""
        cdef int r, place, a0, a1, b0, b1
        if b == NOTHING or self.stop != GOES_ON:
            return a
        if pair_map_find(&self.unions, a, b, &r):
            return r
        if a < 0 and b < 0:
            place = self.signatures.round_values(-1 - b)
            if place < 0:
                return self.fail()
            return self.keep(&self.unions, a, b,
                             self.leaf(self.signatures.insert_key(-1 - a, place)))
        place = min(self.place_of(a), self.place_of(b))
        self.split(a, place, &a0, &a1)
        self.split(b, place, &b0, &b1)
        a0 = self.united(a0, b0)
        a1 = self.united(a1, b1)
        return self.keep(&self.unions, a, b, self.make(place, a0, a1))
