# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Breadth-first exploration of a model in compiled tables, directly into compressed rows.

A batch of states of one level is expanded into one array of successors. These are numbered by the
hash table, and the rows are closed. So the table is probed with prefetching, and a deep exploration
of narrow levels costs no more per state than a wide one.
"""

cimport cython
from libc.stdint cimport int32_t, int64_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy, memset

import numpy as np

from symcheck.kernels.explore.register_machine cimport Instruction, Register, Status, execute
from symcheck.kernels.memory cimport Buffer, array_of, release, reserve
from symcheck.kernels.portable cimport (monotonic_seconds, prefer_huge_pages, prefetch,
                                        trim_heap)
from symcheck.kernels.tuning cimport (BATCH_STATES, BATCH_SUCCESSORS, CLOCK_INTERVAL, INSERT_CHUNK,
                                      LINEAR_SCAN_ENTRIES)

include "_csr_builder.pxi"
include "_orbits.pxi"
include "_state_table.pxi"
include "_successors.pxi"

cpdef enum Outcome:
    COMPLETE = 0
    PAUSED
    BUDGET
    FAULT
    NO_MEMORY
    TOO_MANY


def malloc_trim():
    """Return freed memory that the allocator keeps to the system, if the C library can do that."""
    with nogil:
        trim_heap()


cdef inline int owner_of(const uint64_t* row, const uint64_t* mask, int words, uint64_t seed,
                         int parts) noexcept nogil:
    """The part that owns a state."""
    cdef uint64_t h = seed
    cdef int w
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
        tables: see `symcheck.explicit.tables.Tables`.
        orbits: if given, states are replaced by the representatives of their orbits.
        share: (mask, seed, parts, number): only states that `owners` gives to this part are
            expanded; others have no choices, or an empty row. None: all states.
    Raises:
        MemoryError: memory ended.
    """

    cdef readonly StateSet states
    cdef readonly CsrBuilder rows
    cdef readonly long long explored, level, level_end, fault_state
    cdef readonly int fault_status
    cdef Expander expander
    cdef Orbits orbits
    cdef Buffer ids, counts, target_table
    cdef const uint64_t[::1] mask
    cdef uint64_t seed
    cdef int parts, number

    def __cinit__(self, tables, Orbits orbits: Orbits | None = None, share=None):
        self.orbits = orbits
        self.parts = 1
        if share is not None:
            self.mask, self.seed, self.parts, self.number = share
        self.expander = Expander(tables)
        self.rows = self.expander.rows
        self.states = StateSet(tables.words)
        self.fault_state = -1

    def __dealloc__(self):
        release(&self.ids)
        release(&self.counts)
        release(&self.target_table)

    @property
    def nbytes(self) -> int:
        """Memory held, in bytes."""
        return (self.states.nbytes + self.expander.nbytes + self.ids.size
                + self.counts.size + self.target_table.size)

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

    def run(self, long long budget, double seconds) -> Outcome:
        """Explore until nothing is left, `budget` states are known, or `seconds` have passed.

        Returns:
            The outcome: COMPLETE, PAUSED (time), BUDGET, FAULT, NO_MEMORY or TOO_MANY (2**31
                states).
        """
        cdef int outcome
        with nogil:
            outcome = self._run(budget, monotonic_seconds() + seconds)
        return Outcome(outcome)

    cdef int _run(self, long long budget, double deadline) noexcept nogil:
        cdef long long last_check = self.explored
        cdef int outcome
        while self.explored < self.states.count:
            if self.states.count >= budget:
                return Outcome.BUDGET
            if (self.explored - last_check >= CLOCK_INTERVAL
                    or self.expander.successor_count >= BATCH_SUCCESSORS):
                last_check = self.explored
                if monotonic_seconds() > deadline:
                    return Outcome.PAUSED
            if self.explored >= self.level_end:
                self.level += 1
                self.level_end = self.states.count
            outcome = self._explore_batch()
            if outcome:
                return outcome
        return Outcome.COMPLETE

    cdef int _explore_batch(self) noexcept nogil:
        """Explore some states of one level."""
        cdef const uint64_t* rows = <const uint64_t*> self.states.rows.data
        cdef const uint64_t* row
        cdef long long stop = min(self.level_end, self.explored + BATCH_STATES)
        cdef int status
        self.expander.clear()
        while self.explored < stop and self.expander.successor_count < BATCH_SUCCESSORS:
            row = rows + self.explored * self.states.words
            if self.parts > 1 and owner_of(row, &self.mask[0], self.states.words, self.seed,
                                           self.parts) != self.number:
                status = self.expander.skip()
            else:
                status = self.expander.expand(self.explored, row)
            if status == Status.MEMORY:
                return Outcome.NO_MEMORY
            if status:
                self.fault_status = status
                self.fault_state = self.explored
                return Outcome.FAULT
            self.explored += 1
        status = self._number_successors()
        if status:
            return Outcome.TOO_MANY if status == 2 else Outcome.NO_MEMORY
        return 0

    cdef int _number_successors(self) noexcept nogil:
        """Number the successors of the batch and write its rows."""
        cdef long long row, begin = 0, end, n = self.expander.successor_count
        cdef const double* weights = <const double*> self.expander.weights.data
        cdef int32_t* ids
        cdef int status
        if reserve(&self.ids, n * 4):
            return 1
        ids = <int32_t*> self.ids.data
        if self.orbits is not None:
            if self._count_targets():
                return 1
            self.orbits.represent_rows(<uint64_t*> self.expander.targets.data, n)
        status = self.states.insert(<const uint64_t*> self.expander.targets.data, n, ids)
        if status:
            return status
        for row in range(self.expander.row_count):
            end = (<const int64_t*> self.expander.ends.data)[row]
            if self.rows.close_row(ids + begin, weights + begin, end - begin):
                return 1
            begin = end
        return 0

    cdef int _count_targets(self) noexcept nogil:
        """Count the different successors of each row of the batch; 1 when memory ends."""
        cdef long long row, begin = 0, end
        cdef const uint64_t* targets = <const uint64_t*> self.expander.targets.data
        cdef int32_t* counts
        if reserve(&self.counts, (self.rows.closed + self.expander.row_count) * 4):
            return 1
        counts = <int32_t*> self.counts.data + self.rows.closed
        for row in range(self.expander.row_count):
            end = (<const int64_t*> self.expander.ends.data)[row]
            counts[row] = self._different(targets + begin * self.states.words, end - begin)
            if counts[row] < 0:
                return 1
            begin = end
        return 0

    cdef int32_t _different(self, const uint64_t* rows, long long n) noexcept nogil:
        """The number of different rows; -1 when memory ends."""
        cdef int words = self.states.words
        cdef int32_t count = 0
        cdef long long i
        cdef uint64_t capacity = 4, slot
        cdef int32_t* table
        while capacity < <uint64_t> n * 2:
            capacity *= 2
        if reserve(&self.target_table, capacity * 4):
            return -1
        table = <int32_t*> self.target_table.data
        memset(table, 0, capacity * 4)
        for i in range(n):
            slot = hash_row(rows + i * words, words) & (capacity - 1)
            while table[slot] and not rows_equal(rows + (table[slot] - 1) * words,
                                                 rows + i * words, words):
                slot = (slot + 1) & (capacity - 1)
            if not table[slot]:
                table[slot] = <int32_t> (i + 1)
                count += 1
        return count
