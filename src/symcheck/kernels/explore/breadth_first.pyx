# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Breadth-first exploration of a model in compiled tables, directly into compressed rows.

A batch of states of one level is expanded into one array of successors. These are numbered by the
hash table, and the rows are closed. So the table is probed with prefetching, and a deep exploration
of narrow levels costs no more per state than a wide one.
Other threads may expand blocks of states, whose successors one thread numbers in order.
"""

cimport cython
from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy, memset

from collections import deque

import numpy as np

from symcheck.kernels.explore.register_machine cimport (Instruction, Register, Status, execute,
                                                      raise_interruption)
from symcheck.kernels.memory cimport Buffer, array_of, release, reserve
from symcheck.kernels.portable cimport (monotonic_seconds, prefer_huge_pages, prefetch,
                                        trim_heap)
from symcheck.kernels.tuning cimport (BATCH_STATES, BATCH_SUCCESSORS, BLOCK_STATES, CLOCK_INTERVAL,
                                      INSERT_CHUNK, LINEAR_SCAN_ENTRIES, MANY_STATES_LEFT)

include "_csr_builder.pxi"
include "_orbits.pxi"
include "_state_table.pxi"
include "_successors.pxi"
include "_state_block.pxi"

cpdef enum Outcome:
    COMPLETE = 0
    PAUSED
    BUDGET
    FAULT
    NO_MEMORY
    TOO_MANY

cdef enum:
    MANY_STATES = 100           # an outcome within this file


def malloc_trim():
    """Return freed memory that the allocator keeps to the system, if the C library can do that."""
    with nogil:
        trim_heap()


cdef uint64_t BLOCKS = 0x7FFFFFFFFFFFFFFF
cdef long long NO_LIMIT = 0x1000000000000000


cdef inline int owner_of(const uint64_t* row, const uint64_t* mask, int words, uint64_t seed,
                         int parts) noexcept nogil:
    """The part that owns a state (see `owners`)."""
    cdef uint64_t h = seed
    cdef int w
    if seed == BLOCKS:
        h = 0
        for w in range(words):
            if mask[w]:
                h += (row[w] & mask[w]) / (mask[w] & (~mask[w] + 1))
        return <int> (h % <uint64_t> parts)
    for w in range(words):
        h = (h ^ (row[w] & mask[w])) * 0x94D049BB133111EBULL
        h ^= h >> 31
    h *= 0xBF58476D1CE4E5B9ULL
    return <int> ((h >> 32) % <uint64_t> parts)


def owners(const uint64_t[:, ::1] rows, const uint64_t[::1] mask, long long seed,
           int parts) -> Int32s:
    """The part that owns each of some packed states, by a hash of the bits of a mask.

    Args:
        rows: uint64[n, words].
        mask: uint64[words].
        seed: of the hash. If it is 2**63 - 1, there is no hash: the masked bits of a word are a
            number, and the parts take turns.
    Returns:
        int32[n].
    """
    cdef long long i, n = rows.shape[0]
    cdef int32_t[::1] found = np.zeros(n, dtype=np.int32)
    if parts > 1:
        with nogil:
            for i in range(n):
                found[i] = owner_of(&rows[i, 0], &mask[0], <int> rows.shape[1],
                                    <uint64_t> seed, parts)
    return np.asarray(found)


cdef class Explorer:
    """An exploration that can be paused.

    `add` inserts states and `run` explores; `states` and `rows` hold the states and rows in the
    order of their discovery. `explored` states have been expanded; `level` is the breadth-first
    distance of those that come next. After a fault, `fault_state` is the number of the state in
    which the model breaks a rule, and `fault_status` the status of the register machine.

    Args:
        tables: see `symcheck.explicit.tables.CompiledModel`.
        orbits: if given, states are replaced by the representatives of their orbits.
        share: (mask, seed, parts, number): only states that `owners` gives to this part are
            expanded; others have no choices, or an empty row. None: all states.
        region: (states, within): only the states in this set, or outside of it, are expanded;
            others have a loop. None: all states.
    Raises:
        MemoryError: memory ended.
    """

    cdef readonly StateSet states
    cdef readonly CsrBuilder rows
    cdef readonly long long explored, level, level_end, fault_state
    cdef readonly int fault_status
    cdef long long level_begin
    cdef Expander expander
    cdef Buffer ids, counts
    cdef const uint64_t[::1] mask
    cdef uint64_t seed
    cdef int parts, number
    cdef StateSet region
    cdef bint within
    cdef object blocks          # those that threads expand, in the order of their states
    cdef list free_blocks

    def __cinit__(self, tables, Orbits orbits: Orbits | None = None, share=None,
                  region=None):
        self.parts = 1
        if region is not None:
            self.region, self.within = region
        if share is not None:
            self.mask, self.seed, self.parts, self.number = share
        self.expander = Expander(tables, orbits)
        self.rows = self.expander.rows
        self.states = StateSet(tables.words)
        self.fault_state = -1
        self.forget_blocks()

    def __dealloc__(self):
        release(&self.ids)
        release(&self.counts)

    @property
    def nbytes(self) -> int:
        """Memory held, in bytes; what blocks hold more while threads expand them does not count."""
        cdef StateBlock block
        cdef long long total = 0
        for block in (*self.blocks, *self.free_blocks):
            total += block.nbytes
        return (self.states.nbytes + self.expander.nbytes + self.ids.size + self.counts.size
                + total)

    @property
    def deadlocks(self) -> Int64s:
        """The states without a transition, in the order in which they were found: int64[k]."""
        return array_of(self.expander.deadlocks.data, self.expander.deadlock_count, np.int64)

    @property
    def target_counts(self) -> Int32s:
        """With orbits: the number of successors of each row before they are replaced: int32[rows].
        """
        return array_of(self.counts.data, self.rows.closed, np.int32)

    def add(self, const uint64_t[:, ::1] rows):
        """Insert states (uint64[n, words]) to be explored; known ones are ignored."""
        cdef int32_t[::1] ids
        if rows.shape[0] == 0:
            return
        if reserve(&self.ids, rows.shape[0] * 4):
            raise MemoryError
        ids = <int32_t[:rows.shape[0]]> <int32_t*> self.ids.data
        self.states.add(rows, ids)
        if self.explored == 0:
            self.level_end = self.states.count

    def run(self, long long budget, double seconds, pool: Executor | None = None,
            int threads=1, long long entries=NO_LIMIT) -> Outcome:
        """Explore until nothing is left, `budget` states are known, `seconds` have passed, or this
        call has written `entries` entries of rows.

        Args:
            pool: `threads` - 1 threads, which expand states beside this one; the states, their
                numbers and the rows do not depend on them. They are used while many states are
                left, and with neither a share nor a region. Their entries are not limited.
        Returns:
            The outcome: COMPLETE, PAUSED (time), BUDGET (also of entries), FAULT, NO_MEMORY or
                TOO_MANY (2**31 states).
        """
        cdef int outcome
        cdef double deadline = monotonic_seconds() + seconds
        if pool is None or self.parts > 1 or self.region is not None:
            with nogil:
                outcome = self._run(budget, deadline, MAX_STATES, self.rows.entries + entries)
        else:
            outcome = self._run_in_blocks(budget, deadline, pool, threads)
        raise_interruption(self.expander.tables.decider)
        return Outcome(outcome)

    def forget_blocks(self):
        """Forget what threads have expanded ahead: their pool has ended."""
        self.blocks, self.free_blocks = deque(), []

    cdef int _run(self, long long budget, double deadline, long long many,
                  long long entries) noexcept nogil:
        """Explore in this thread, also until `many` states are left, or rows have `entries`."""
        cdef long long last_check = self.explored
        cdef int outcome
        while self.explored < self.states.count:
            if ((self.states.count >= budget or self.rows.entries >= entries)
                    and self._between_batches()):
                return Outcome.BUDGET
            if self.states.count - self.explored >= many and self._between_batches():
                return MANY_STATES
            if (self.explored - last_check >= CLOCK_INTERVAL
                    or self.expander.successor_count >= BATCH_SUCCESSORS):
                last_check = self.explored
                if monotonic_seconds() > deadline:
                    return Outcome.PAUSED
            self._begin_level()
            outcome = self._explore_batch()
            if outcome:
                return outcome
        return Outcome.COMPLETE

    cdef bint _between_batches(self) noexcept nogil:
        """Whether a batch is complete, or a level; only the number of successors cuts a batch."""
        return (self.explored >= self.level_end
                or (self.explored - self.level_begin) % BATCH_STATES == 0)

    cdef void _begin_level(self) noexcept nogil:
        """Begin the next level if this one is explored."""
        if self.explored >= self.level_end:
            self.level += 1
            self.level_begin, self.level_end = self.explored, self.states.count

    cdef int _explore_batch(self) noexcept nogil:
        """Explore some states of one level."""
        cdef const uint64_t* rows = <const uint64_t*> self.states.rows.data
        cdef const uint64_t* row
        cdef long long batch = (self.explored - self.level_begin) // BATCH_STATES + 1
        cdef long long stop = min(self.level_end, self.level_begin + batch * BATCH_STATES)
        cdef int status
        self.expander.clear()
        while self.explored < stop and self.expander.successor_count < BATCH_SUCCESSORS:
            row = rows + self.explored * self.states.words
            if self.parts > 1 and owner_of(row, &self.mask[0], self.states.words, self.seed,
                                           self.parts) != self.number:
                status = self.expander.skip()
            elif self.region is not None and self.region.has(row) != self.within:
                status = self.expander.stay(row)
            else:
                status = self.expander.expand(self.explored, row)
            if status:
                return self._failed(status, self.explored)
            self.explored += 1
        if self.expander.represent():
            return Outcome.NO_MEMORY
        return self._number_successors(self.expander, 0, self.expander.row_count)

    cdef int _failed(self, int status, long long state) noexcept nogil:
        """The outcome if the expansion of a state has failed."""
        if status == Status.MEMORY:
            return Outcome.NO_MEMORY
        self.fault_status = status
        self.fault_state = state
        return Outcome.FAULT

    cdef int _number_successors(self, Expander source, long long first, long long end
                                ) noexcept nogil:
        """Number the successors in some rows of a batch, and close these rows."""
        cdef const int64_t* ends = <const int64_t*> source.ends.data
        cdef const double* weights = <const double*> source.weights.data
        cdef long long row, begin = ends[first - 1] if first else 0, n
        cdef int32_t* ids
        cdef int status
        if first == end:
            return 0
        n = ends[end - 1] - begin
        if reserve(&self.ids, n * 4):
            return Outcome.NO_MEMORY
        ids = <int32_t*> self.ids.data
        if source.orbits is not None:
            if reserve(&self.counts, (self.rows.closed + end - first) * 4):
                return Outcome.NO_MEMORY
            memcpy(<int32_t*> self.counts.data + self.rows.closed,
                   <const int32_t*> source.counts.data + first, (end - first) * 4)
        status = self.states.insert(<const uint64_t*> source.targets.data
                                    + begin * self.states.words, n, ids)
        if status:
            return Outcome.TOO_MANY if status == 2 else Outcome.NO_MEMORY
        weights += begin
        for row in range(first, end):
            n = ends[row] - begin
            if self.rows.close_row(ids, weights, n):
                return Outcome.NO_MEMORY
            ids += n
            weights += n
            begin = ends[row]
        return 0

    # -------------------------------------------------------------------------------- threads

    cdef int _run_in_blocks(self, long long budget, double deadline, pool, int threads) except -1:
        """Explore with threads that expand blocks of states; this one numbers their successors, in
        order, and expands a block itself if the next one in order is not ready.
        """
        cdef StateBlock block
        cdef int outcome
        while True:
            if not self.blocks:
                with nogil:
                    outcome = self._run(budget, deadline, MANY_STATES_LEFT, NO_LIMIT)
                if outcome != MANY_STATES:
                    return outcome
            self._fill_blocks(pool, 2 * threads)
            block = self.blocks[0]
            if block.first + block.numbered.states != self.explored:      # an interrupt came between two lines of this
                self.forget_blocks()
            elif block.ready:
                with nogil:
                    outcome = self._number_block(block, budget)
                if outcome:
                    return outcome
                self.free_blocks.append(self.blocks.popleft())
                if monotonic_seconds() > deadline:
                    return Outcome.PAUSED
            else:
                for other in self.blocks:
                    if not (<StateBlock> other).ready and (<StateBlock> other).task.cancel():
                        (<StateBlock> other).expand()
                        break
                else:
                    block.task.result()

    cdef int _fill_blocks(self, pool, int most) except -1:
        """Let the pool expand further states, up to a number of blocks.

        Blocks end with batches, so that the numbers of states at which an exploration stops at its
        budget do not depend on threads.
        """
        cdef StateBlock last, block
        cdef long long first, end, n = self.states.count
        cdef long long size = BLOCK_STATES
        while len(self.blocks) < most:
            first = self.explored
            if self.blocks:
                last = self.blocks[len(self.blocks) - 1]
                first = last.first + last.size
            end = min(first + size, self.level_end) if first < self.level_end else first + size
            if end > n:
                break
            block = (self.free_blocks.pop() if self.free_blocks
                     else StateBlock(self.expander.tables, self.expander.orbits))
            block.load(first, end - first, self.states)
            block.task = pool.submit(block.expand)
            self.blocks.append(block)
        return 0

    cdef int _number_block(self, StateBlock block, long long budget) noexcept nogil:
        """Number the successors in a block, batch by batch."""
        cdef BatchEnd before, end
        cdef bint grouped = self.expander.grouped
        cdef int outcome
        while block.next_batch < block.batches:
            if self.states.count >= budget:
                return Outcome.BUDGET
            self._begin_level()
            before, end = block.numbered, (<const BatchEnd*> block.ends.data)[block.next_batch]
            if (self.rows.adopt(block.expander.rows, before.rows, end.rows,
                                before.states if grouped else 0, end.states if grouped else 0)
                    or self.expander.add_deadlocks(block.expander, before.deadlocks,
                                                   end.deadlocks)):
                return Outcome.NO_MEMORY
            self.explored += end.states - before.states
            outcome = self._number_successors(block.expander, before.rows, end.rows)
            if outcome:
                return outcome
            block.numbered = end
            block.next_batch += 1
        if block.status:
            if self.states.count >= budget:
                return Outcome.BUDGET
            return self._failed(block.status, block.first + block.failed)
        return 0
