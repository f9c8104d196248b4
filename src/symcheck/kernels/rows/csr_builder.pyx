# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Compressed rows that are written one after the other and renumbered at the end.

Most models have few distinct probabilities or rates. While they are fewer than 2**16, an entry holds the number of its
value in two bytes: that halves the memory of the search, whose peak is what large models fail on.
"""

from libc.stdint cimport int32_t, int64_t, uint16_t, uint32_t, uint64_t
from libc.stdlib cimport free, malloc
from libc.string cimport memcpy, memset

from symcheck.kernels.memory cimport Buffer, release, reserve

ctypedef fused Weight:
    uint16_t
    double

cdef enum:
    SCAN = 24  # entries of a row up to which duplicates are looked for one by one
    DISTINCT = 65535  # values that have codes
    PLACES = 131072  # of their hash table


cdef void sort_row(int32_t* indices, Weight* weights, long long n) noexcept nogil:
    """Sort a row by column. Shell's sort: short rows are the rule, and need a single insertion pass."""
    cdef long long i, j, gap = 1
    cdef int32_t column
    cdef Weight weight
    while gap * 9 < n:
        gap = gap * 3 + 1
    while gap > 0:
        for i in range(gap, n):
            column, weight = indices[i], weights[i]
            j = i
            while j >= gap and indices[j - gap] > column:
                indices[j], weights[j] = indices[j - gap], weights[j - gap]
                j -= gap
            indices[j], weights[j] = column, weight
        gap //= 3


cdef class RowStore:
    """No rows yet; `structures` rewards belong to each row.

    A row is opened (it has an action and rewards from then on) and later closed with its entries, in the same order.
    Functions that give an int give 0, or 1 where there is no memory.
    """

    def __cinit__(self, int structures):
        self.structures = structures
        self.rewards = <Buffer*> malloc((structures + 1) * sizeof(Buffer))
        if self.rewards == NULL:
            raise MemoryError
        memset(self.rewards, 0, (structures + 1) * sizeof(Buffer))

    def __dealloc__(self):
        self._drop()
        free(self.rewards)

    cdef void _drop(self) noexcept nogil:
        cdef int s
        release(&self.starts)
        release(&self.ends_of_groups)
        release(&self.actions)
        release(&self.indices)
        release(&self.codes)
        release(&self.weights)
        release(&self.distinct)
        release(&self.places)
        release(&self.row)
        release(&self.table)
        if self.rewards != NULL:
            for s in range(self.structures):
                release(&self.rewards[s])

    @property
    def nbytes(self):
        """Memory held, in bytes."""
        cdef long long total = (self.starts.size + self.ends_of_groups.size + self.actions.size + self.indices.size
                                + self.codes.size + self.weights.size)
        for s in range(self.structures):
            total += self.rewards[s].size
        return total

    # ------------------------------------------------------------------------------------------ writing

    cdef int open(self) noexcept nogil:
        """One more row, with no action and rewards of 0."""
        cdef int s
        if reserve(&self.actions, (self.opened + 1) * 4):
            return 1
        (<int32_t*> self.actions.data)[self.opened] = -1
        for s in range(self.structures):
            if reserve(&self.rewards[s], (self.opened + 1) * 8):
                return 1
            (<double*> self.rewards[s].data)[self.opened] = 0.0
        self.opened += 1
        return 0

    cdef void label(self, int action) noexcept nogil:
        """Give the last row an action."""
        (<int32_t*> self.actions.data)[self.opened - 1] = action

    cdef int end_group(self) noexcept nogil:
        """The rows opened since the last time are the choices of one state."""
        if reserve(&self.ends_of_groups, (self.groups + 1) * 8):
            return 1
        (<int64_t*> self.ends_of_groups.data)[self.groups] = self.opened
        self.groups += 1
        return 0

    cdef int close(self, const int32_t* ids, const double* weights, long long n) noexcept nogil:
        """The entries of the next row; weights of equal columns are summed."""
        cdef int32_t* indices
        if (reserve(&self.indices, (self.entries + n) * 4) or reserve(&self.row, n * 8)
                or reserve(&self.starts, (self.closed + 2) * 8)):
            return 1
        indices = <int32_t*> self.indices.data + self.entries
        if n > SCAN:
            n = self._merge_wide(ids, weights, n, indices, <double*> self.row.data)
            if n < 0:
                return 1
        else:
            n = self._merge(ids, weights, n, indices, <double*> self.row.data)
        if self._append(<double*> self.row.data, n):
            return 1
        self.entries += n
        self.closed += 1
        (<int64_t*> self.starts.data)[self.closed] = self.entries
        if self.closed == 1:
            (<int64_t*> self.starts.data)[0] = 0
        return 0

    cdef long long _merge(self, const int32_t* ids, const double* weights, long long n, int32_t* indices, double* row) noexcept nogil:
        cdef long long i, j, size = 0
        for i in range(n):
            j = 0
            while j < size and indices[j] != ids[i]:
                j += 1
            if j < size:
                row[j] += weights[i]
            else:
                indices[size] = ids[i]
                row[size] = weights[i]
                size += 1
        return size

    cdef long long _merge_wide(self, const int32_t* ids, const double* weights, long long n, int32_t* indices,
                               double* row) noexcept nogil:
        """The same for long rows, through a small table of positions; -1 if there is no memory."""
        cdef long long i, size = 0
        cdef uint64_t capacity = 64, place
        cdef int32_t* table
        while capacity < <uint64_t> n * 2:
            capacity *= 2
        if reserve(&self.table, capacity * 4):
            return -1
        table = <int32_t*> self.table.data
        memset(table, 0, capacity * 4)
        for i in range(n):
            place = (<uint64_t> ids[i] * 0x9E3779B97F4A7C15ULL >> 20) & (capacity - 1)
            while table[place] and indices[table[place] - 1] != ids[i]:
                place = (place + 1) & (capacity - 1)
            if table[place]:
                row[table[place] - 1] += weights[i]
            else:
                indices[size] = ids[i]
                row[size] = weights[i]
                size += 1
                table[place] = <int32_t> size
        return size

    cdef int _append(self, const double* row, long long n) noexcept nogil:
        """Store the weights of a row."""
        cdef long long i
        if not self.wide:
            if reserve(&self.codes, (self.entries + n) * 2):
                return 1
            for i in range(n):
                if self._code(row[i], <uint16_t*> self.codes.data + self.entries + i):
                    if self._widen():
                        return 1
                    break
        if self.wide:
            if reserve(&self.weights, (self.entries + n) * 8):
                return 1
            memcpy(<double*> self.weights.data + self.entries, row, n * 8)
        return 0

    cdef int _code(self, double value, uint16_t* code) noexcept nogil:
        """The code of a value; 1 if there are too many values."""
        cdef uint64_t bits, place
        cdef uint32_t* places
        memcpy(&bits, &value, 8)
        if self.places.data == NULL:
            if reserve(&self.places, PLACES * 4) or reserve(&self.distinct, (DISTINCT + 1) * 8):
                return 1
            memset(self.places.data, 0, PLACES * 4)
        places = <uint32_t*> self.places.data
        place = (bits * 0x9E3779B97F4A7C15ULL >> 40) & (PLACES - 1)
        while places[place]:
            if (<uint64_t*> self.distinct.data)[places[place] - 1] == bits:
                code[0] = <uint16_t> (places[place] - 1)
                return 0
            place = (place + 1) & (PLACES - 1)
        if self.distinct_count == DISTINCT:
            return 1
        (<uint64_t*> self.distinct.data)[self.distinct_count] = bits
        code[0] = <uint16_t> self.distinct_count
        self.distinct_count += 1
        places[place] = self.distinct_count
        return 0

    cdef int _widen(self) noexcept nogil:
        """From codes to values."""
        cdef long long i
        if reserve(&self.weights, (self.entries + 1) * 8):
            return 1
        for i in range(self.entries):
            (<double*> self.weights.data)[i] = (<double*> self.distinct.data)[(<uint16_t*> self.codes.data)[i]]
        release(&self.codes)
        self.wide = True
        return 0

    # ------------------------------------------------------------------------------------------ the result

    def finish(self, const int32_t[::1] order, const int32_t[::1] rank, int64_t[::1] indptr, int32_t[::1] indices,
               double[::1] data, groups, int32_t[::1] actions, list rewards):
        """The rows, with states renumbered: new number i is old number `order[i]`, and `rank` is its inverse.

        Once: the memory is given back on the way. Columns come out ascending. Shapes: indptr int64[rows+1], indices
        int32[entries], data float64[entries], groups int64[states+1] or None (one row per state), actions int32[rows],
        rewards: one float64[rows] per structure.
        """
        cdef int64_t[::1] own_groups
        cdef double[::1] out
        cdef long long n = order.shape[0], i, row, new = 0, begin, end, at = 0, size
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef int s
        cdef bint grouped = groups is not None
        if n == 0:
            return
        if grouped:
            own_groups = groups
        with nogil:
            indptr[0] = 0
            if grouped:
                own_groups[0] = 0
            self._renumber(&rank[0])
            for i in range(n):
                self._span(order[i], grouped, &begin, &end)
                for row in range(begin, end):
                    size = starts[row + 1] - starts[row]
                    memcpy(&indices[at], <int32_t*> self.indices.data + starts[row], size * 4)
                    at += size
                    new += 1
                    indptr[new] = at
                    actions[new - 1] = (<int32_t*> self.actions.data)[row]
                if grouped:
                    own_groups[i + 1] = new
            release(&self.indices)
            release(&self.actions)
            at = 0
            for i in range(n):
                self._span(order[i], grouped, &begin, &end)
                size = starts[end] - starts[begin]
                if self.wide:
                    memcpy(&data[at], <double*> self.weights.data + starts[begin], size * 8)
                else:
                    for row in range(size):
                        data[at + row] = (<double*> self.distinct.data)[(<uint16_t*> self.codes.data)[starts[begin] + row]]
                at += size
            release(&self.codes)
            release(&self.weights)
        for s in range(self.structures):
            out = rewards[s]
            new = 0
            with nogil:
                for i in range(n):
                    self._span(order[i], grouped, &begin, &end)
                    for row in range(begin, end):
                        out[new] = (<double*> self.rewards[s].data)[row]
                        new += 1
        self._drop()

    cdef void _span(self, long long state, bint grouped, long long* begin, long long* end) noexcept nogil:
        """The rows of a state."""
        if grouped:
            begin[0] = (<int64_t*> self.ends_of_groups.data)[state - 1] if state else 0
            end[0] = (<int64_t*> self.ends_of_groups.data)[state]
        else:
            begin[0] = state
            end[0] = state + 1

    cdef void _renumber(self, const int32_t* rank) noexcept nogil:
        """Rename columns in place and sort each row by them."""
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef int32_t* indices = <int32_t*> self.indices.data
        cdef long long row, i
        for i in range(self.entries):
            indices[i] = rank[indices[i]]
        for row in range(self.closed):
            if self.wide:
                sort_row(indices + starts[row], <double*> self.weights.data + starts[row], starts[row + 1] - starts[row])
            else:
                sort_row(indices + starts[row], <uint16_t*> self.codes.data + starts[row], starts[row + 1] - starts[row])
