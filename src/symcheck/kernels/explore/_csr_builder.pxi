# Compressed rows that are written one after the other and renumbered at the end.
#
# Most models have few distinct probabilities or rates. While there are fewer than 2**16, an entry
# stores the two-byte code of its value: that halves the peak memory of the exploration.

ctypedef fused Weight:
    uint16_t
    double

cdef enum:
    MAX_DISTINCT_WEIGHTS = 65535     # a code has two bytes
    CODE_TABLE_SIZE = 131072         # of their hash table: it is at most half full
    DIGITS = 2048                    # of the numbers that long rows are sorted by
    LONG_ROW = 1024                  # entries from which on that is faster


cdef void sort_row(int32_t* indices, Weight* weights, long long n) noexcept nogil:
    """Sort a row by column with Shell's sort: short rows, the usual case, need one insertion pass.
    """
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


cdef void sort_long_row(int32_t* indices, Weight* weights, long long n, int32_t* more_indices,
                         Weight* more_weights) noexcept nogil:
    """Sort a row by column with a radix sort, with room for a copy of the row."""
    cdef long long[DIGITS] start
    cdef long long i, position, total, count
    cdef int shift = 0, d
    cdef int32_t greatest = 0
    for i in range(n):
        greatest = max(greatest, indices[i])
    while shift < 31 and (shift == 0 or greatest >> shift):
        memset(start, 0, DIGITS * sizeof(long long))
        for i in range(n):
            start[(indices[i] >> shift) & (DIGITS - 1)] += 1
        total = 0
        for d in range(DIGITS):
            count = start[d]
            start[d] = total
            total += count
        for i in range(n):
            d = (indices[i] >> shift) & (DIGITS - 1)
            position = start[d]
            start[d] += 1
            more_indices[position], more_weights[position] = indices[i], weights[i]
        memcpy(indices, more_indices, n * sizeof(int32_t))
        memcpy(weights, more_weights, n * sizeof(Weight))
        shift += 11


cdef void sort_rows(int32_t* indices, Weight* weights, const int64_t* starts, long long first,
                    long long end) noexcept nogil:
    """Sort the rows `first` to `end` - 1 by column."""
    cdef long long row, n, longest = 0
    cdef Buffer more_indices = Buffer(NULL, 0, 0), more_weights = Buffer(NULL, 0, 0)
    for row in range(first, end):
        longest = max(longest, starts[row + 1] - starts[row])
    cdef bint room = longest >= LONG_ROW and not (
        reserve(&more_indices, longest * sizeof(int32_t))
        or reserve(&more_weights, longest * sizeof(Weight)))
    for row in range(first, end):
        n = starts[row + 1] - starts[row]
        if n >= LONG_ROW and room:
            sort_long_row(indices + starts[row], weights + starts[row], n,
                          <int32_t*> more_indices.data, <Weight*> more_weights.data)
        else:
            sort_row(indices + starts[row], weights + starts[row], n)
    release(&more_indices)
    release(&more_weights)


@cython.final
cdef class CsrBuilder:
    """A matrix in compressed rows under construction.

    A row is opened, which gives it an action and rewards, and later closed with its entries; rows
    are closed in the order in which they were opened. Functions that return an int return 0, or 1
    when memory ends.

    Args:
        structures: number of rewards of each row.
    """

    cdef readonly long long opened, closed, groups, entries, longest  # row, before it is merged
    cdef readonly bint shares  # whether weights were divided by another number than a power of 2
    cdef int structures
    cdef Buffer* rewards
    cdef Buffer starts, group_ends, actions, indices
    # weights: codes of the distinct values or, if `raw_weights`, the values themselves
    cdef bint raw_weights
    cdef Buffer weight_codes, weights, distinct_weights, code_table
    cdef uint32_t distinct_count
    cdef Buffer row, merge_table

    def __cinit__(self, int structures):
        self.structures = structures
        self.rewards = <Buffer*> malloc((structures + 1) * sizeof(Buffer))
        if self.rewards == NULL:
            raise MemoryError
        memset(self.rewards, 0, (structures + 1) * sizeof(Buffer))

    def __dealloc__(self):
        self._release()
        free(self.rewards)

    cdef void _release(self) noexcept nogil:
        """Free all arrays."""
        cdef int s
        release(&self.starts)
        release(&self.group_ends)
        release(&self.actions)
        release(&self.indices)
        release(&self.weight_codes)
        release(&self.weights)
        release(&self.distinct_weights)
        release(&self.code_table)
        release(&self.row)
        release(&self.merge_table)
        if self.rewards != NULL:
            for s in range(self.structures):
                release(&self.rewards[s])

    @property
    def nbytes(self) -> int:
        """Memory held, in bytes."""
        cdef long long total = (self.starts.size + self.group_ends.size + self.actions.size
                                + self.indices.size + self.weight_codes.size + self.weights.size)
        for s in range(self.structures):
            total += self.rewards[s].size
        return total

    # -------------------------------------------------------------------------------- writing

    cdef int open_row(self) noexcept nogil:
        """Open a row without an action and with rewards of 0."""
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

    cdef void set_action(self, int action) noexcept nogil:
        """Set the action of the row that was opened last."""
        (<int32_t*> self.actions.data)[self.opened - 1] = action

    cdef int end_group(self) noexcept nogil:
        """Make the rows opened since the last call the choices of one state."""
        if reserve(&self.group_ends, (self.groups + 1) * 8):
            return 1
        (<int64_t*> self.group_ends.data)[self.groups] = self.opened
        self.groups += 1
        return 0

    cdef int adopt(self, CsrBuilder other, long long first, long long end, long long first_group,
                   long long end_group) noexcept nogil:
        """Open the rows `first` to `end` - 1 of another builder, with their actions, rewards and
        groups.
        """
        cdef int s
        cdef long long g, size = end - first
        self.shares = self.shares or other.shares
        if (reserve(&self.actions, (self.opened + size) * 4)
                or reserve(&self.group_ends, (self.groups + end_group - first_group) * 8)):
            return 1
        memcpy(<int32_t*> self.actions.data + self.opened,
               <const int32_t*> other.actions.data + first, size * 4)
        for s in range(self.structures):
            if reserve(&self.rewards[s], (self.opened + size) * 8):
                return 1
            memcpy(<double*> self.rewards[s].data + self.opened,
                   <const double*> other.rewards[s].data + first, size * 8)
        for g in range(first_group, end_group):
            (<int64_t*> self.group_ends.data)[self.groups] = (
                (<const int64_t*> other.group_ends.data)[g] - first + self.opened)
            self.groups += 1
        self.opened += size
        return 0

    cdef int close_row(self, const int32_t* ids, const double* weights, long long n) noexcept nogil:
        """Write the entries of the next row; weights of equal columns are added."""
        cdef int32_t* indices
        if (reserve(&self.indices, (self.entries + n) * 4) or reserve(&self.row, n * 8)
                or reserve(&self.starts, (self.closed + 2) * 8)):
            return 1
        self.longest = max(self.longest, n)
        indices = <int32_t*> self.indices.data + self.entries
        if n > LINEAR_SCAN_ENTRIES:
            n = self._merge_long(ids, weights, n, indices, <double*> self.row.data)
            if n < 0:
                return 1
        else:
            n = self._merge_short(ids, weights, n, indices, <double*> self.row.data)
        if self._append(<double*> self.row.data, n):
            return 1
        self.entries += n
        self.closed += 1
        (<int64_t*> self.starts.data)[self.closed] = self.entries
        if self.closed == 1:
            (<int64_t*> self.starts.data)[0] = 0
        return 0

    cdef long long _merge_short(self, const int32_t* ids, const double* weights, long long n,
                                int32_t* indices, double* row) noexcept nogil:
        """Add up the weights of equal columns by linear search; returns the number of entries."""
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

    cdef long long _merge_long(self, const int32_t* ids, const double* weights, long long n,
                               int32_t* indices, double* row) noexcept nogil:
        """Add up the weights of equal columns by a hash table; -1 when memory ends."""
        cdef long long i, size = 0
        cdef uint64_t capacity = 64, slot
        cdef int32_t* merge_table
        while capacity < <uint64_t> n * 2:
            capacity *= 2
        if reserve(&self.merge_table, capacity * 4):
            return -1
        merge_table = <int32_t*> self.merge_table.data
        memset(merge_table, 0, capacity * 4)
        for i in range(n):
            slot = (<uint64_t> ids[i] * 0x9E3779B97F4A7C15ULL >> 20) & (capacity - 1)
            while merge_table[slot] and indices[merge_table[slot] - 1] != ids[i]:
                slot = (slot + 1) & (capacity - 1)
            if merge_table[slot]:
                row[merge_table[slot] - 1] += weights[i]
            else:
                indices[size] = ids[i]
                row[size] = weights[i]
                size += 1
                merge_table[slot] = <int32_t> size
        return size

    cdef int _append(self, const double* row, long long n) noexcept nogil:
        """Store the weights of a row."""
        cdef long long i
        if not self.raw_weights:
            if reserve(&self.weight_codes, (self.entries + n) * 2):
                return 1
            for i in range(n):
                if self._encode(row[i], <uint16_t*> self.weight_codes.data + self.entries + i):
                    if self._store_raw_weights():
                        return 1
                    break
        if self.raw_weights:
            if reserve(&self.weights, (self.entries + n) * 8):
                return 1
            memcpy(<double*> self.weights.data + self.entries, row, n * 8)
        return 0

    cdef int _encode(self, double value, uint16_t* code) noexcept nogil:
        """Find the code of a value; 1 if there are too many values."""
        cdef uint64_t bits, slot
        cdef uint32_t* code_table
        memcpy(&bits, &value, 8)
        if self.code_table.data == NULL:
            if (reserve(&self.code_table, CODE_TABLE_SIZE * 4)
                    or reserve(&self.distinct_weights, (MAX_DISTINCT_WEIGHTS + 1) * 8)):
                return 1
            memset(self.code_table.data, 0, CODE_TABLE_SIZE * 4)
        code_table = <uint32_t*> self.code_table.data
        slot = (bits * 0x9E3779B97F4A7C15ULL >> 40) & (CODE_TABLE_SIZE - 1)
        while code_table[slot]:
            if (<uint64_t*> self.distinct_weights.data)[code_table[slot] - 1] == bits:
                code[0] = <uint16_t> (code_table[slot] - 1)
                return 0
            slot = (slot + 1) & (CODE_TABLE_SIZE - 1)
        if self.distinct_count == MAX_DISTINCT_WEIGHTS:
            return 1
        (<uint64_t*> self.distinct_weights.data)[self.distinct_count] = bits
        code[0] = <uint16_t> self.distinct_count
        self.distinct_count += 1
        code_table[slot] = self.distinct_count
        return 0

    cdef int _store_raw_weights(self) noexcept nogil:
        """Replace the codes of all weights by their values."""
        cdef long long i
        cdef const double* values = <double*> self.distinct_weights.data
        cdef const uint16_t* codes = <uint16_t*> self.weight_codes.data
        if reserve(&self.weights, (self.entries + 1) * 8):
            return 1
        for i in range(self.entries):
            (<double*> self.weights.data)[i] = values[codes[i]]
        release(&self.weight_codes)
        self.raw_weights = True
        return 0

    # -------------------------------------------------------------------------------- result

    # The rows are written with renumbered states; columns ascend in each row. `place` comes first,
    # then `renumber`, `write_columns`, `write_weights` and `write_rewards`; the parts of a step may
    # run in several threads. The builder gives its memory back on the way. Arguments:
    #   order: int32[states], the old number of each new state; rank: int32[states], its inverse.
    #   indptr: int64[rows+1]; indices: int32[entries]; data: float64[entries].
    #   groups: int64[states+1], or None if each state has one row.

    @property
    def starts_of_rows(self) -> Int64s:
        """Where each row begins, and the number of entries: int64[rows+1]."""
        return (array_of(self.starts.data, self.closed + 1, np.int64) if self.closed
                else np.zeros(1, np.int64))

    def place(self, const int32_t[::1] order, int64_t[::1] indptr, groups: Int64s | None,
              int32_t[::1] actions):
        """Write where each row begins, and its action (int32[rows], -1 for none)."""
        cdef int64_t[::1] group_ptr
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef long long i, row, new = 0, begin, end
        cdef bint grouped = groups is not None
        if grouped:
            group_ptr = groups
        with nogil:
            for i in range(order.shape[0]):
                self._row_range(order[i], grouped, &begin, &end)
                for row in range(begin, end):
                    actions[new] = (<int32_t*> self.actions.data)[row]
                    indptr[new + 1] = indptr[new] + starts[row + 1] - starts[row]
                    new += 1
                if grouped:
                    group_ptr[i + 1] = new
            release(&self.actions)

    def renumber(self, const int32_t[::1] rank, long long first, long long end):
        """Renumber the columns of the rows `first` to `end` - 1 in place, and sort each row."""
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef int32_t* indices = <int32_t*> self.indices.data
        cdef long long i
        if first == end:
            return
        with nogil:
            for i in range(starts[first], starts[end]):
                indices[i] = rank[indices[i]]
            if self.raw_weights:
                sort_rows(indices, <double*> self.weights.data, starts, first, end)
            else:
                sort_rows(indices, <uint16_t*> self.weight_codes.data, starts, first, end)

    def write_columns(self, const int32_t[::1] order, const int64_t[::1] indptr,
                      groups: Int64s | None, int32_t[::1] indices, long long first, long long end):
        """Write the columns of the new states `first` to `end` - 1."""
        cdef const int64_t[::1] group_ptr
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef long long i, begin, stop, position
        cdef bint grouped = groups is not None
        if grouped:
            group_ptr = groups
        if first == end:
            return
        with nogil:
            position = indptr[group_ptr[first] if grouped else first]
            for i in range(first, end):
                self._row_range(order[i], grouped, &begin, &stop)
                memcpy(&indices[0] + position, <int32_t*> self.indices.data + starts[begin],
                       (starts[stop] - starts[begin]) * 4)
                position += starts[stop] - starts[begin]

    def release_columns(self):
        """Give the memory of the columns back."""
        release(&self.indices)

    def write_weights(self, const int32_t[::1] order, const int64_t[::1] indptr,
                      groups: Int64s | None, double[::1] data, long long first, long long end):
        """Write the entries of the new states `first` to `end` - 1."""
        cdef const int64_t[::1] group_ptr
        cdef const int64_t* starts = <const int64_t*> self.starts.data
        cdef const double* values = <double*> self.distinct_weights.data
        cdef const uint16_t* codes = <uint16_t*> self.weight_codes.data
        cdef double* out
        cdef long long i, k, begin, stop
        cdef bint grouped = groups is not None
        if grouped:
            group_ptr = groups
        if first == end:
            return
        with nogil:
            out = &data[0] + indptr[group_ptr[first] if grouped else first]
            for i in range(first, end):
                self._row_range(order[i], grouped, &begin, &stop)
                if self.raw_weights:
                    memcpy(out, <double*> self.weights.data + starts[begin],
                           (starts[stop] - starts[begin]) * 8)
                else:
                    for k in range(starts[begin], starts[stop]):
                        out[k - starts[begin]] = values[codes[k]]
                out += starts[stop] - starts[begin]

    def write_rewards(self, const int32_t[::1] order, grouped: bool, rewards: list[Floats]):
        """Write the rewards, a float64[rows] per structure, and give all memory back."""
        cdef double[::1] out
        cdef long long i, row, new, begin, end
        cdef bint several = grouped
        cdef int s
        for s in range(self.structures):
            out = rewards[s]
            new = 0
            with nogil:
                for i in range(order.shape[0]):
                    self._row_range(order[i], several, &begin, &end)
                    for row in range(begin, end):
                        out[new] = (<double*> self.rewards[s].data)[row]
                        new += 1
        self._release()

    cdef void _row_range(self, long long state, bint grouped, long long* begin,
                         long long* end) noexcept nogil:
        """The rows of a state."""
        if grouped:
            begin[0] = (<int64_t*> self.group_ends.data)[state - 1] if state else 0
            end[0] = (<int64_t*> self.group_ends.data)[state]
        else:
            begin[0] = state
            end[0] = state + 1
