# The unique table of diagram nodes.

cdef struct Node:
    int32_t bit, low, high


cdef class Nodes:
    """The unique table of nodes. A negative child or node is the leaf -1 - child."""

    cdef int bits
    cdef int64_t limit
    cdef Stop stop
    cdef readonly long long operations
    cdef public long long budget
    cdef Buffer storage          # of the nodes
    cdef int32_t* table
    cdef int64_t mask, nodes

    cdef int64_t bytes_used(self) noexcept nogil:
        """Memory held, in bytes."""
        return self.storage.size + 4 * (self.mask + 1)

    @cython.final
    cdef inline Node* node(self, int64_t x) noexcept nogil:
        """The node with a number."""
        return <Node*>self.storage.data + x

    @cython.final
    cdef inline int fail(self) noexcept nogil:
        """Note that memory ended."""
        if self.stop == RUNNING:
            self.stop = OUT_OF_MEMORY
        return EMPTY

    @cython.final
    cdef inline int bit_of(self, int x) noexcept nogil:
        """The bit of a node; `bits` for leaves."""
        return self.bits if x < 0 else self.node(x).bit

    @cython.final
    cdef inline void children(self, int x, int bit, int* low, int* high) noexcept nogil:
        """The children of a node at a bit, which are the node itself if it does not depend on the
        bit.
        """
        if x >= 0 and self.node(x).bit == bit:
            low[0] = self.node(x).low
            high[0] = self.node(x).high
        else:
            low[0] = x
            high[0] = x

    @cython.final
    cdef inline bint tick(self) noexcept nogil:
        """Count an operation, and check the limits from time to time; whether to stop."""
        self.operations += 1
        return (self.operations & (CHECK_INTERVAL - 1)) == 0 and self.check_limits()

    cdef bint check_limits(self) noexcept nogil:
        """Whether to stop: the limits of memory and operations, and signals."""
        if self.bytes_used() > self.limit:
            self.fail()
        else:
            with gil:
                if PyErr_CheckSignals() != 0:
                    self.stop = SIGNAL
                elif self.operations > self.budget:
                    self.stop = OUT_OF_BUDGET
        return self.stop != RUNNING

    @cython.final
    cdef int make(self, int bit, int low, int high) noexcept nogil:
        """The node with these children."""
        cdef int64_t at
        cdef int x
        cdef Node* node
        if low == high or self.stop != RUNNING:
            return low
        if self.tick():
            return EMPTY
        at = <int64_t>mix_pair(pair_key(low, high), bit) & self.mask
        while self.table[at] >= 0:
            x = self.table[at]
            node = self.node(x)
            if node.low == low and node.high == high and node.bit == bit:
                return x
            at = (at + 1) & self.mask
        if (self.nodes >= MAX_NODES
                or reserve(&self.storage, (self.nodes + 1) * sizeof(Node))):
            return self.fail()
        x = <int>self.nodes
        self.node(x)[0] = Node(bit, low, high)
        self.table[at] = x
        self.nodes += 1
        if 2 * self.nodes > self.mask and self.rehash() < 0:
            return self.fail()
        return x

    @cython.final
    cdef int rehash(self) noexcept nogil:
        """Double the hash table; -1 when memory ends."""
        cdef int64_t mask = 2 * self.mask + 1, at, x
        cdef Node* node
        cdef int32_t* table = <int32_t*>malloc((mask + 1) * sizeof(int32_t))
        if table == NULL:
            return -1
        memset(table, 0xFF, (mask + 1) * sizeof(int32_t))
        for x in range(self.nodes):
            node = self.node(x)
            at = <int64_t>mix_pair(pair_key(node.low, node.high), node.bit) & mask
            while table[at] >= 0:
                at = (at + 1) & mask
            table[at] = <int32_t>x
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    @cython.final
    cdef inline int memoise(self, PairMap* memo, int a, int b, int result) noexcept nogil:
        """Store the result of a pair."""
        if self.stop == RUNNING and pair_map_insert(memo, a, b, result) < 0:
            return self.fail()
        return result

    @cython.final
    cdef inline int leaf(self, int vector) noexcept nogil:
        """The leaf of a signature or block number; -1 says that memory ended."""
        return self.fail() if vector < 0 else -1 - vector

    @cython.final
    cdef int raise_if_stopped(self) except -1:
        """Raise the exception of the reason to stop, if there is one."""
        cdef Stop stop = self.stop
        self.stop = RUNNING
        if stop == SIGNAL:
            return raise_pending()
        if stop == OUT_OF_MEMORY:
            raise MemoryError
        if stop == OUT_OF_BUDGET:
            raise OverflowError
        return 0
