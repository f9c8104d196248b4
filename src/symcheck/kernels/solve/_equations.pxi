# Equations x = A x + b with non-negative A and b, and the blocks of some states that are copied from
# them.
#
# Values are pairs (lower, upper), stored side by side. Rows are rounded outwards (`rounding.pxd`), so
# each update maps true bounds to true bounds, whatever the machine rounds.

cdef class Equations:
    """A system of equations in compressed rows.

    Args:
        indptr, indices, data: int64[rows+1], int32, float64: A.
        groups: int64[states+1], the rows (choices) of each state; None if each state has one.
        lower, upper: float64[rows], bounds on b; None for 0.
        exit_mass: float64[rows], the mass that leaves the matrix; None for 0.
        mode: 0 without choices, 1 minimum, 2 maximum.
        unknown: uint8[states], the states that the equations determine, where other states of the
            matrix have known values; None for all.
        normalise: whether rows and their constants are divided by all that leaves the state.
        error: of the coefficients and constants, relative.
    """

    cdef const int64_t[::1] indptr, groups
    cdef const int32_t[::1] indices
    cdef const double[::1] data
    cdef const double[::1] constant_low, constant_high, exit_mass   # None where they are 0
    cdef const uint8_t[::1] unknown  # None: all states
    cdef bint normalise
    cdef readonly double error
    cdef int32_t[::1] local_index  # of the states of the block that is loaded; None before
    cdef readonly int64_t n
    cdef readonly int mode

    def __init__(self, indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None,
                 lower: Floats | None, upper: Floats | None, exit_mass: Floats | None, int mode,
                 unknown: Masks | None = None, bint normalise=False,
                 double error=8.0 * UNIT_ROUNDOFF):
        self.indptr, self.indices, self.data = indptr, indices, data
        self.constant_low, self.constant_high, self.exit_mass = lower, upper, exit_mass
        self.mode = mode
        self.n = indptr.shape[0] - 1 if groups is None else groups.shape[0] - 1
        self.groups = np.zeros(1, dtype=np.int64) if groups is None else groups
        self.unknown = unknown
        self.normalise = normalise
        self.error = error
        self.local_index = None

    cdef void number_states(self, const int32_t[::1] states):
        """Number the states of a block."""
        cdef int64_t i
        if self.local_index is None:
            self.local_index = np.full(self.n, -1, dtype=np.int32)
        for i in range(states.shape[0]):
            self.local_index[states[i]] = <int32_t>i

    cdef void clear_numbers(self, const int32_t[::1] states) noexcept nogil:
        """Forget the numbers of the states of a block."""
        cdef int64_t i
        for i in range(states.shape[0]):
            self.local_index[states[i]] = -1

    cdef bint is_redundant(self, int64_t state, int64_t row) noexcept nogil:
        """Whether a row only loops on its state.

        Its value is then infinite, which is never the minimum, or 0, which is never needed for the
        maximum.
        """
        cdef int64_t k
        if self.mode == 0 or (self.exit_mass is not None and self.exit_mass[row] > 0.0):
            return False
        for k in range(self.indptr[row], self.indptr[row + 1]):
            if self.indices[k] != state and self.data[k] > 0.0:
                return False
        return self.mode == 1 or self.constant_high is None or self.constant_high[row] == 0.0

    cdef void bounds_near_underflow(self, int64_t state, int64_t row, const double* x, Sum total,
                                    double* low, double* high) noexcept nogil:
        """Bounds of b_row + (A_row x without the block that is loaded, and without the loop on the
        state), divided by `total`, where doubles lose digits.
        """
        cdef bint constants = self.constant_low is not None
        cdef Sum lo = sum_of(self.constant_low[row] if constants else 0.0)
        cdef Sum hi = sum_of(self.constant_high[row] if constants else 0.0)
        cdef double lost = 0.0, least = DBL_MIN * DBL_EPSILON  # the smallest double
        cdef int64_t k
        cdef int32_t c
        for k in range(self.indptr[row], self.indptr[row + 1]):
            c = self.indices[k]
            if c == state or (self.local_index is not None and self.local_index[c] >= 0):
                continue
            lo = add_product(lo, self.data[k], x[2 * <int64_t>c])
            hi = add_product(hi, self.data[k], x[2 * <int64_t>c + 1])
            lost += (product_underflows(self.data[k], x[2 * <int64_t>c])
                     or product_underflows(self.data[k], x[2 * <int64_t>c + 1]))
        low[0] = high[0] = 0.0
        if is_positive(hi) or lost > 0.0:
            high[0] = quotient(hi, total) + least + 2.0 * lost * least / rounded(total)
            if lost == 0.0:
                low[0] = max(quotient(lo, total) - least, 0.0)


cdef class EquationBlock:
    """The equations of some states, copied together, with self-loops divided out.

    x_s = opt over the rows r of s of (b_r + sum of a_rt x_t). Local state s owns the local rows
    groups[s] to groups[s+1]; rows that only loop on s are left out. Row r has the entries indptr[r]
    to indptr[r+1] of `indices` and `data`, and a constant between `constant_low` and
    `constant_high`; these four arrays may be longer than needed. `x` are bounds on the values, and
    `policy` the row (counted among the rows of its state) that gave the bound that a strategy
    attains, -1: none yet; both are allocated on first use. `mode`: 0 without choices, 1 minimum, 2
    maximum; it is 0, too, if every state has one row. `grouped`: whether the system has choices.
    `has_exit`: whether some mass leaves the block.
    """

    cdef Equations system
    cdef const int32_t[::1] states
    cdef readonly int64_t n, rows, entries
    cdef readonly int mode
    cdef readonly bint has_exit, grouped
    cdef int64_t[::1] row_ptr, group_ptr
    cdef readonly int32_t[::1] indices
    cdef readonly double[::1] data, constant_low, constant_high
    cdef double[::1] exit_mass
    cdef int32_t[::1] row_offset  # of each row among those of its state; None if none is left out
    cdef int32_t[::1] policy_rows
    cdef double[:, ::1] bounds
    cdef double start_low, start_high
    cdef bint started

    cdef allocate(self, bint offsets):
        """Make room for the numbers of states, rows and entries, and one more.

        A memory view that was never set has length 0, and is not None.
        """
        if self.group_ptr.shape[0] <= self.n:
            self.group_ptr = np.empty(with_spare(self.n), dtype=np.int64)
        if self.row_ptr.shape[0] <= self.rows:
            size = with_spare(self.rows)
            self.row_ptr = np.empty(size, dtype=np.int64)
            self.constant_low, self.constant_high = np.empty(size), np.empty(size)
            self.exit_mass = np.empty(size)
        if self.indices.shape[0] <= self.entries:
            size = with_spare(self.entries)
            self.indices, self.data = np.empty(size, dtype=np.int32), np.empty(size)
        self.row_offset = np.empty(self.rows, dtype=np.int32) if offsets else None

    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x):
        """Copy the equations of `states`; the bounds in `x` (float64[n, 2]) of all other states
        count as known.
        """
        cdef int64_t n = states.shape[0], i, r, s, first, last
        cdef bint grouped = system.mode != 0, is_redundant = False
        self.system, self.states = system, states
        self.n = n
        self.rows = self.entries = 0
        with nogil:
            for i in range(n):
                s = states[i]
                first = system.groups[s] if grouped else s
                last = system.groups[s + 1] if grouped else s + 1
                self.rows += last - first
                self.entries += system.indptr[last] - system.indptr[first]
                for r in range(first, last):
                    is_redundant = is_redundant or system.is_redundant(s, r)
        self.mode = system.mode
        self.grouped = grouped
        self.started = False
        self.allocate(is_redundant)
        system.number_states(states)
        with nogil:
            copy_rows(self, system, x)
            system.clear_numbers(states)
            if grouped and self.is_chain():
                self.mode = 0

    cdef start_bounds(self):
        """Set `x` and `policy` to the first bounds, once per load.

        The value of a state that leaves the block almost surely is an average of b / exit_mass over
        the rows: for probabilities this is the maximum principle; rewards have better starts.
        """
        cdef int64_t i
        cdef int32_t choice = 0 if self.mode == 0 else -1
        if self.started:
            return
        if self.bounds.shape[0] <= self.n:
            self.bounds = np.empty((with_spare(self.n), 2))
        if self.grouped and self.policy_rows.shape[0] <= self.n:
            self.policy_rows = np.empty(with_spare(self.n), dtype=np.int32)
        for i in range(self.n):
            self.bounds[i, 0] = self.start_low
            self.bounds[i, 1] = self.start_high
            if self.grouped:
                self.policy_rows[i] = choice
        self.started = True

    @property
    def x(self) -> Floats:
        """The bounds: float64[n, 2]. They may be written to, as long as they remain bounds."""
        self.start_bounds()
        return np.asarray(self.bounds)[: self.n]

    @property
    def policy(self) -> Int32s:
        """The policy: int32[n], which may be written to; empty without choices."""
        self.start_bounds()
        return (np.asarray(self.policy_rows)[: self.n]
                if self.grouped else np.empty(0, dtype=np.int32))

    @property
    def indptr(self) -> Int64s:
        """Starts of the rows: int64[rows+1]."""
        return np.asarray(self.row_ptr)[: self.rows + 1]

    @property
    def groups(self) -> Int64s:
        """Starts of the rows of each state: int64[n+1]."""
        return np.asarray(self.group_ptr)[: self.n + 1]

    @property
    def error(self) -> float:
        """The relative error of the coefficients and constants of the system."""
        return self.system.error

    def exit_masses(self) -> Floats:
        """The mass that leaves the block, per row, with self-loops divided out: float64[rows]."""
        return np.array(self.exit_mass[: self.rows])

    def global_rows(self, const int32_t[::1] policy) -> Int64s:
        """The rows of the system that a policy (int32[n]) chooses: int64[n], -1 for none."""
        cdef int64_t i
        cdef int64_t[::1] out = np.empty(self.n, dtype=np.int64)
        for i in range(self.n):
            out[i] = self.global_row(i, policy[i])
        return np.asarray(out)

    cdef int64_t global_row(self, int64_t i, int64_t choice) noexcept nogil:
        """The row of the system that is a choice of local state i, -1 for none."""
        if choice < 0:
            return -1
        if self.row_offset is not None:
            choice = self.row_offset[self.group_ptr[i] + choice]
        return self.system.groups[self.states[i]] + choice

    cdef bint is_chain(self) noexcept nogil:
        """Whether every state has one row, so that the policy is known."""
        cdef int64_t i
        for i in range(self.n):
            if self.group_ptr[i + 1] != i + 1:
                return False
        return True

    cdef void store(self, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil:
        """Write bounds and choices back to arrays over all states; `strategy` may be empty."""
        cdef int64_t i
        cdef bint global_rows = self.grouped and strategy.shape[0] > 0
        for i in range(self.n):
            x[self.states[i], 0] = self.bounds[i, 0]
            x[self.states[i], 1] = self.bounds[i, 1]
            if global_rows and self.policy_rows[i] >= 0:
                strategy[self.states[i]] = self.global_row(i, self.policy_rows[i])


cdef inline int64_t with_spare(int64_t size) noexcept nogil:
    """A somewhat larger size for small blocks, many of which are loaded one after the other."""
    if size > 100_000:
        return size + 1
    return size + size // 4 if size > 64 else 80


cdef void copy_rows(EquationBlock block, Equations system, double[:, ::1] x) noexcept nogil:
    """Copy the rows, add the known bounds in `x` to their constants, and find the first bounds."""
    cdef const int32_t[::1] indices = system.indices
    cdef const double[::1] data = system.data
    cdef int32_t[::1] local_index = system.local_index
    cdef int64_t* row_ptr = &block.row_ptr[0]
    cdef int64_t* group_ptr = &block.group_ptr[0]
    cdef bint grouped = block.grouped, constants = system.constant_low is not None, tiny
    cdef int64_t i, r, k, s, first, last, rows = 0, entries = 0, first_entry
    cdef int32_t c
    cdef double lo, hi, scale, loop, terms, leaves, margin, lowest = INFINITY, highest = 0.0
    cdef Sum total, exit_sum
    block.has_exit = False
    row_ptr[0] = 0
    for i in range(block.n):
        s = block.states[i]
        group_ptr[i] = rows
        first = system.groups[s] if grouped else s
        last = system.groups[s + 1] if grouped else s + 1
        for r in range(first, last):
            if block.row_offset is not None and system.is_redundant(s, r):
                continue
            first_entry = entries
            lo = system.constant_low[r] if constants else 0.0
            hi = system.constant_high[r] if constants else 0.0
            exit_sum = sum_of(system.exit_mass[r] if system.exit_mass is not None else 0.0)
            total = sum_of(0.0)
            loop = 0.0
            terms = EXTRA_ROUNDINGS
            for k in range(system.indptr[r], system.indptr[r + 1]):
                c = local_index[indices[k]]
                if c == i:
                    loop = loop + data[k]
                elif c >= 0:
                    block.indices[entries] = c
                    block.data[entries] = data[k]
                    entries += 1
                    total = add_term(total, data[k])
                else:
                    lo = lo + data[k] * x[indices[k], 0]
                    hi = hi + data[k] * x[indices[k], 1]
                    exit_sum = add_term(exit_sum, data[k])
                    terms = terms + 1.0
            total = add_sum(total, exit_sum)
            leaves = rounded(exit_sum)
            tiny = lo >= 0.0 and hi < NEAR_UNDERFLOW and terms > EXTRA_ROUNDINGS
            if tiny:
                system.bounds_near_underflow(s, r, &x[0, 0], sum_of(1.0), &lo, &hi)
            if not is_positive(total):
                entries = first_entry
                if hi > 0.0:
                    lo = hi = INFINITY  # the reward is collected forever
            if (loop > 0.0 or system.normalise) and is_positive(total):
                scale = divide_by(1.0, total)
                for k in range(first_entry, entries):
                    block.data[k] = block.data[k] * scale
                if tiny:
                    system.bounds_near_underflow(s, r, &x[0, 0], total, &lo, &hi)
                else:
                    lo = lo * scale
                    hi = hi * scale
                leaves = quotient(exit_sum, total)
            margin = error_of_row(<int64_t>(terms - EXTRA_ROUNDINGS), system.error)
            lo = lo - fabs(lo) * margin if lo < INFINITY else lo
            hi = (hi + fabs(hi) * margin
                  + (UNDERFLOW_MARGIN if terms > EXTRA_ROUNDINGS and hi != 0.0 and not tiny
                     else 0.0))
            if is_positive(exit_sum):
                block.has_exit = True
                if leaves > 0.0:
                    lowest = min(lowest, lo / leaves)
                    highest = max(highest, hi / leaves)
            block.exit_mass[rows] = leaves
            block.constant_low[rows] = lo
            block.constant_high[rows] = hi
            if block.row_offset is not None:
                block.row_offset[rows] = <int32_t>(r - first)
            rows += 1
            row_ptr[rows] = entries
    group_ptr[block.n] = rows
    block.rows = rows
    block.entries = entries
    margin = error_of_row(0, system.error)
    lowest = lowest * (1.0 - margin)
    highest = highest * (1.0 + margin)
    block.start_low = 0.0 if lowest > 1.0 else lowest
    block.start_high = 1.0 if highest > 1.0 else highest
