# Signatures: the product of a matrix and the partition.

cdef class Signatures(Nodes):
    """Matrices and the operations on signatures; see Partition."""

    cdef int leaves
    cdef const int[::1] level, low, high, roots
    cdef const double[::1] weight
    cdef SignatureTable signatures
    # memoised results: (matrix node, partition) -> signature; two signatures -> their sum;
    # (set, signature) -> set; (signature, shift) -> signature
    cdef PairMap images, sums, unions, scales

    @cython.final
    cdef int image(self, int m, int p) noexcept nogil:
        """The sums of each row over the blocks: matrix node times partition node.

        It sums over the column bits from the top bit of the two nodes on.
        """
        cdef int r, bit, m0, m1, m00, m01, m10, m11, p0, p1
        if p == EMPTY or self.stop != RUNNING or (m < self.leaves and self.weight[m] == 0.0):
            return EMPTY
        if m < self.leaves and p < 0:
            return self.leaf(self.signatures.singleton(-1 - p, self.weight[m]))
        if pair_map_find(&self.images, m, p, &r):
            return r
        bit = min(self.level[m] >> 1, self.bit_of(p))
        self.matrix_children(m, 2 * bit, &m0, &m1)
        self.matrix_children(m0, 2 * bit + 1, &m00, &m01)
        self.matrix_children(m1, 2 * bit + 1, &m10, &m11)
        self.children(p, bit, &p0, &p1)
        m0 = self.sum(self.image_below(m00, p0, bit), self.image_below(m01, p1, bit))
        m1 = self.sum(self.image_below(m10, p0, bit), self.image_below(m11, p1, bit))
        return self.memoise(&self.images, m, p, self.make(bit, m0, m1))

    @cython.final
    cdef inline void matrix_children(self, int m, int level, int* low, int* high) noexcept nogil:
        """The children of a matrix node at a level."""
        if self.level[m] == level:
            low[0] = self.low[m]
            high[0] = self.high[m]
        else:
            low[0] = m
            high[0] = m

    @cython.final
    cdef inline int image_below(self, int m, int p, int bit) noexcept nogil:
        """The image from the bit after `bit` on: each column bit that neither node depends on
        doubles it.
        """
        cdef int r = self.image(m, p)
        cdef int gap = min(self.level[m] >> 1, self.bit_of(p)) - bit - 1
        return r if gap == 0 or r == EMPTY else self.scale(r, gap)

    @cython.final
    cdef int scale(self, int a, int shift) noexcept nogil:
        """A signature times 2 ** shift."""
        cdef int r, low, high
        if a == EMPTY or self.stop != RUNNING:
            return EMPTY
        if pair_map_find(&self.scales, a, shift, &r):
            return r
        if a < 0:
            r = self.leaf(self.signatures.shift_left(-1 - a, shift))
        else:
            low = self.scale(self.node(a).low, shift)
            high = self.scale(self.node(a).high, shift)
            r = self.make(self.node(a).bit, low, high)
        return self.memoise(&self.scales, a, shift, r)

    @cython.final
    cdef int sum(self, int a, int b) noexcept nogil:
        """The sum of two signatures."""
        cdef int r, bit, a0, a1, b0, b1
        if a == EMPTY:
            return b
        if b == EMPTY:
            return a
        if self.stop != RUNNING:
            return EMPTY
        if a > b:
            a, b = b, a
        if pair_map_find(&self.sums, a, b, &r):
            return r
        if b < 0:
            return self.memoise(&self.sums, a, b, self.leaf(self.signatures.add(-1 - a, -1 - b)))
        bit = min(self.bit_of(a), self.bit_of(b))
        self.children(a, bit, &a0, &a1)
        self.children(b, bit, &b0, &b1)
        a0 = self.sum(a0, b0)
        a1 = self.sum(a1, b1)
        return self.memoise(&self.sums, a, b, self.make(bit, a0, a1))

    @cython.final
    cdef int union(self, int a, int b) noexcept nogil:
        """The set of signatures `a` with the signature `b` added."""
        cdef int r, bit, a0, a1, b0, b1
        if b == EMPTY or self.stop != RUNNING:
            return a
        if pair_map_find(&self.unions, a, b, &r):
            return r
        if a < 0 and b < 0:
            bit = self.signatures.round_values(-1 - b)
            if bit < 0:
                return self.fail()
            return self.memoise(&self.unions, a, b,
                                self.leaf(self.signatures.insert_key(-1 - a, bit)))
        bit = min(self.bit_of(a), self.bit_of(b))
        self.children(a, bit, &a0, &a1)
        self.children(b, bit, &b0, &b1)
        a0 = self.union(a0, b0)
        a1 = self.union(a1, b1)
        return self.memoise(&self.unions, a, b, self.make(bit, a0, a1))
