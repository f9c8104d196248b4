# Nodes of diagrams, each kept once.

cdef class Nodes:
    """A table of nodes. A child or a node that is negative is the leaf -1 - child."""

    cdef int bits
    cdef int64_t limit
    cdef Stop stop
    cdef uint64_t ticks
    cdef public double deadline  # of processor time (time.process_time)
    cdef Buffer places, lows, highs
    cdef int32_t* table
    cdef int64_t mask, nodes

    cdef int64_t used(self) noexcept nogil:
        """Bytes in use."""
        return self.places.size + self.lows.size + self.highs.size + 4 * (self.mask + 1)

    @cython.final
    cdef inline int fail(self) noexcept nogil:
        if self.stop == GOES_ON:
            self.stop = NO_MEMORY
        return NOTHING

    @cython.final
    cdef inline int place_of(self, int x) noexcept nogil:
        return self.bits if x < 0 else (<int32_t*>self.places.data)[x]

    @cython.final
    cdef inline void split(self, int x, int place, int* low, int* high) noexcept nogil:
        if x >= 0 and (<int32_t*>self.places.data)[x] == place:
            low[0] = (<int32_t*>self.lows.data)[x]
            high[0] = (<int32_t*>self.highs.data)[x]
        else:
            low[0] = x
            high[0] = x

    @cython.final
    cdef inline bint tick(self) noexcept nogil:
        self.ticks += 1
        return (self.ticks & 0xFFFF) == 0 and self.look_up()

    cdef bint look_up(self) noexcept nogil:
        """Whether to stop: memory, time or a signal."""
        if self.used() > self.limit:
            self.fail()
        else:
            with gil:
                if PyErr_CheckSignals() != 0:
                    self.stop = SIGNAL
                elif process_time() > self.deadline:
                    self.stop = LATE
        return self.stop != GOES_ON

    @cython.final
    cdef int make(self, int place, int low, int high) noexcept nogil:
        """The node with these children."""
        cdef int64_t at
        cdef int x
        if low == high or self.stop != GOES_ON:
            return low
        if self.tick():
            return NOTHING
        at = <int64_t>mix_pair(pair_key(low, high), place) & self.mask
        while self.table[at] >= 0:
            x = self.table[at]
            if ((<int32_t*>self.lows.data)[x] == low and (<int32_t*>self.highs.data)[x] == high
                    and (<int32_t*>self.places.data)[x] == place):
                return x
            at = (at + 1) & self.mask
        if (self.nodes >= 0x7FFFFFF0 or reserve(&self.places, 4 * (self.nodes + 1))
                or reserve(&self.lows, 4 * (self.nodes + 1))
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

    @cython.final
    cdef int rehash(self) noexcept nogil:
        cdef int64_t mask = 2 * self.mask + 1, at, x
        cdef int32_t* table = <int32_t*>malloc((mask + 1) * sizeof(int32_t))
        if table == NULL:
            return -1
        memset(table, 0xFF, (mask + 1) * sizeof(int32_t))
        for x in range(self.nodes):
            at = <int64_t>mix_pair(pair_key((<int32_t*>self.lows.data)[x],
                                            (<int32_t*>self.highs.data)[x]),
                                   (<int32_t*>self.places.data)[x]) & mask
            while table[at] >= 0:
                at = (at + 1) & mask
            table[at] = <int32_t>x
        free(self.table)
        self.table = table
        self.mask = mask
        return 0

    @cython.final
    cdef inline int keep(self, PairMap* memo, int a, int b, int result) noexcept nogil:
        if self.stop == GOES_ON and pair_map_insert(memo, a, b, result) < 0:
            return self.fail()
        return result

    @cython.final
    cdef inline int leaf(self, int bag) noexcept nogil:
        return self.fail() if bag < 0 else -1 - bag

    @cython.final
    cdef int ended(self) except -1:
        cdef Stop stop = self.stop
        self.stop = GOES_ON
        if stop == SIGNAL:
            return pending()
        if stop == NO_MEMORY:
            raise MemoryError
        if stop == LATE:
            raise TimeoutError
        return 0
