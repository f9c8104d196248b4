# Blocks of states whose successors a thread finds, while the main thread numbers those of others.

cdef struct BatchEnd:
    long long states, rows, deadlocks


@cython.final
cdef class StateBlock:
    """States that are expanded beside other work, in batches of BATCH_STATES.

    After `expand`, `batches` of them are complete, and `ends` says how many states, rows and
    deadlocks of the block there are up to the end of each. A `status` other than 0 is that of the
    state with the index `failed`, in the batch after them. The successors of the batches before
    `next_batch`, up to `numbered`, have numbers. `nbytes` is the memory held when no thread last
    worked on it.
    """

    cdef Expander expander
    cdef Buffer sources, ends
    cdef long long first, size, batches, failed, next_batch, nbytes
    cdef BatchEnd numbered
    cdef int status
    cdef bint ready
    cdef object task             # its future

    def __cinit__(self, tables, Orbits orbits: Orbits | None):
        self.expander = Expander(tables, orbits)

    def __dealloc__(self):
        release(&self.sources)
        release(&self.ends)

    cdef int load(self, long long first, long long size, StateSet states) except -1:
        """Copy the states to be expanded: the set may move while a thread reads them."""
        cdef size_t width = states.words * 8
        if (reserve(&self.sources, size * width)
                or reserve(&self.ends, (size // BATCH_STATES + 1) * sizeof(BatchEnd))):
            raise MemoryError
        memcpy(self.sources.data, <const char*> states.rows.data + first * width, size * width)
        self.first, self.size, self.next_batch = first, size, 0
        self.numbered = BatchEnd(0, 0, 0)
        self.nbytes = self.expander.nbytes + self.sources.size
        self.ready = False
        return 0

    def expand(self):
        """Find the successors of the states."""
        with nogil:
            self._expand(self.expander)
        self.nbytes = self.expander.nbytes + self.sources.size
        self.ready = True

    cdef void _expand(self, Expander e) noexcept nogil:
        cdef const uint64_t* row = <const uint64_t*> self.sources.data
        cdef long long i
        e.clear()
        e.deadlock_count = e.rows.opened = e.rows.groups = 0
        self.batches = self.status = 0
        for i in range(self.size):
            self.status = e.expand(self.first + i, row + i * e.words)
            if self.status:
                self.failed = i
                break
            if (i + 1) % BATCH_STATES == 0 or i + 1 == self.size:
                (<BatchEnd*> self.ends.data)[self.batches] = BatchEnd(i + 1, e.row_count,
                                                                      e.deadlock_count)
                self.batches += 1
        if e.represent():
            self.status, self.failed, self.batches = Status.MEMORY, 0, 0
