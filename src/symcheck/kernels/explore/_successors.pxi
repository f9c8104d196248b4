# Successors of packed states: guards, updates, products of synchronised commands.

Branches: TypeAlias = "tuple[Int64s, Int64s, Int32s, Floats, Words, Int64s]"

cdef enum Kind:
    DTMC = 0
    CTMC = 1
    MDP = 2
    MA = 3

cdef enum:
    RACE = -2    # the action of a row of rates, beside rows of probabilities


@cython.final
cdef class Expander:
    """A model given as tables (see `symcheck.explicit.tables.CompiledModel`).

    `expand` appends the successors of a state to the batch (`targets`, `weights`) and opens its
    rows in `rows`, where row i of the batch ends at `ends[i]`; `clear` begins the next batch.
    """

    cdef object tables
    cdef readonly CsrBuilder rows
    # the model
    cdef int kind, words, variables, structures, markovian
    cdef bint check_sums, grouped, separate
    cdef double tolerance
    cdef const int32_t[:, ::1] fields, program
    cdef const int64_t[::1] lows
    cdef const uint64_t[::1] ranges
    cdef const int32_t[::1] command_guard, command_code, command_updates, update_probability
    cdef const int32_t[::1] update_code, update_assignments
    cdef const uint64_t[:, ::1] update_keep, update_preset
    cdef const int32_t[::1] assignment_register, assignment_variable
    cdef const int32_t[::1] event_action, event_parts, part_commands, part_list, part_forest
    cdef const int32_t[::1] forest, action_rewards
    cdef const int32_t[:, ::1] rewards
    cdef int root, events
    cdef const Instruction* code
    cdef Register* r
    cdef void* decider
    # scratch of one state, and the arrays that hold it
    cdef list scratch
    cdef int32_t* candidates
    cdef int32_t* enabled
    cdef int32_t* enabled_begin
    cdef double* enabled_total
    cdef int* enabled_status
    cdef int32_t* part_begin
    cdef int32_t* chosen
    cdef double* evaluated_weight
    cdef int32_t* evaluated_update
    cdef uint64_t* evaluated_value
    cdef uint64_t* level_words
    cdef int candidate_count, enabled_count, evaluated_count, part_count
    cdef int joint_choices, row_action
    # scratch of one batch; with orbits, the different successors of each row are counted, and
    # `distinct` says in which rows all of them are
    cdef Orbits orbits
    cdef bint is_distinct
    cdef Buffer targets, weights, ends, deadlocks, counts, distinct, target_table
    cdef long long successor_count, row_count, deadlock_count

    def __cinit__(self, tables, Orbits orbits: Orbits | None = None):
        self.tables = tables
        self.orbits = orbits
        self.kind = tables.kind
        self.grouped = self.separate = self.kind == Kind.MDP or self.kind == Kind.MA
        self.markovian = tables.markovian
        self.words = tables.words
        self.tolerance = tables.tolerance
        self.fields, self.lows, self.ranges = tables.fields, tables.lows, tables.ranges
        self.variables = self.fields.shape[0]
        self.program = tables.program
        self.command_guard, self.command_code = tables.command_guard, tables.command_code
        self.command_updates, self.check_sums = tables.command_updates, tables.check_sums
        self.update_probability, self.update_code = tables.update_probability, tables.update_code
        self.update_assignments = tables.update_assignments
        self.update_keep, self.update_preset = tables.update_keep, tables.update_preset
        self.assignment_register, self.assignment_variable = (tables.assignment_register,
                                                              tables.assignment_variable)
        self.event_action, self.event_parts = tables.event_action, tables.event_parts
        self.part_commands, self.part_list, self.part_forest = (tables.part_commands,
                                                                tables.part_list,
                                                                tables.part_forest)
        self.forest, self.root = tables.forest, tables.root
        self.action_rewards, self.rewards, self.structures = (tables.action_rewards,
                                                              tables.rewards, tables.structures)
        self.events = self.event_action.shape[0]
        self.code = <const Instruction*> &self.program[0, 0]
        self.decider = <void*> tables.decider  # the tables keep it
        self._allocate(tables.slots, tables.most_updates, tables.most_commands, tables.most_parts)
        self.rows = CsrBuilder(self.structures)

    def _allocate(self, slots, int updates, int commands, int parts):
        """Allocate the scratch of one state."""
        cdef int64_t[::1] registers = np.append(slots, 0)
        self.scratch = [registers]
        self.r = <Register*> &registers[0]
        self.candidates = <int32_t*> self._room(self.events + commands, 4)
        self.enabled = <int32_t*> self._room(commands, 4)
        self.enabled_begin = <int32_t*> self._room(commands, 4)
        self.enabled_total = <double*> self._room(commands, 8)
        self.enabled_status = <int*> self._room(commands, sizeof(int))
        self.part_begin = <int32_t*> self._room(parts, 4)
        self.chosen = <int32_t*> self._room(parts, 4)
        self.evaluated_weight = <double*> self._room(updates, 8)
        self.evaluated_update = <int32_t*> self._room(updates, 4)
        self.evaluated_value = <uint64_t*> self._room(updates, 8 * self.words)
        self.level_words = <uint64_t*> self._room(parts, 8 * self.words)

    cdef void* _room(self, int count, int width) except NULL:
        """Memory for items of some bytes, and two more of them, as long as this object lives."""
        cdef uint64_t[::1] room = np.empty((count + 2) * (width + 7) // 8 + 1, np.uint64)
        self.scratch.append(room)
        return &room[0]

    def __dealloc__(self):
        release(&self.targets)
        release(&self.weights)
        release(&self.ends)
        release(&self.deadlocks)
        release(&self.counts)
        release(&self.distinct)
        release(&self.target_table)

    @property
    def nbytes(self) -> int:
        """Memory held, in bytes."""
        return (self.rows.nbytes + self.targets.size + self.weights.size + self.deadlocks.size
                + self.counts.size + self.target_table.size)

    def successors(self, const uint64_t[:, ::1] states) -> tuple[int, int, Branches | None]:
        """Branches of packed states, for tables in which each joint choice is a row (`kind` 2).

        Args:
            states: uint64[n, words], packed states.
        Returns:
            (status, state, arrays). Status 0: the arrays are choice_ends int64[n] (end of each
            state's choices), branch_ends int64[choices] (end of each choice's branches), actions
            int32[choices] (-1: none), weights float64[branches], targets uint64[branches, words]
            and deadlocks int64[d] (numbers of states without a choice; each of them has one choice,
            a loop of weight 1). Any other status: the model breaks a rule in the state with this
            number, and the arrays are None.
        Raises:
            MemoryError: no memory for the branches; the next call begins anew.
        """
        cdef long long i, n = states.shape[0]
        cdef int status = 0
        self.clear()
        self.deadlock_count = self.rows.opened = self.rows.groups = 0
        for i in range(n):
            status = self.expand(i, &states[i, 0])
            if status == Status.MEMORY:
                raise MemoryError
            if status:
                raise_interruption(self.tables.decider)
                return status, i, None
        return (0, n, (array_of(self.rows.group_ends.data, self.rows.groups, np.int64),
                       array_of(self.ends.data, self.row_count, np.int64),
                       array_of(self.rows.actions.data, self.rows.opened, np.int32),
                       array_of(self.weights.data, self.successor_count, np.float64),
                       array_of(self.targets.data, self.successor_count * self.words,
                                np.uint64).reshape(-1, self.words),
                       array_of(self.deadlocks.data, self.deadlock_count, np.int64)))

    cdef void clear(self) noexcept nogil:
        """Begin a batch."""
        self.successor_count = 0
        self.row_count = 0

    cdef int represent(self) noexcept nogil:
        """With orbits, count the different successors of each row of the batch, and replace them by
        representatives; 1 when memory ends.
        """
        cdef long long row, begin = 0, end
        cdef uint64_t* targets = <uint64_t*> self.targets.data
        cdef int32_t* counts
        if self.orbits is None:
            return 0
        if reserve(&self.counts, self.row_count * 4):
            return 1
        counts = <int32_t*> self.counts.data
        for row in range(self.row_count):
            end = (<const int64_t*> self.ends.data)[row]
            counts[row] = (<int32_t> (end - begin) if (<const uint8_t*> self.distinct.data)[row]
                           else self._different(targets + begin * self.words, end - begin))
            if counts[row] < 0:
                return 1
            begin = end
        self.orbits.represent_rows(targets, self.successor_count)
        return 0

    cdef int32_t _different(self, const uint64_t* rows, long long n) noexcept nogil:
        """The number of different rows; -1 when memory ends."""
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
            slot = hash_row(rows + i * self.words, self.words) & (capacity - 1)
            while table[slot] and not rows_equal(rows + (table[slot] - 1) * self.words,
                                                 rows + i * self.words, self.words):
                slot = (slot + 1) & (capacity - 1)
            if not table[slot]:
                table[slot] = <int32_t> (i + 1)
                count += 1
        return count

    # ------------------------------------------------------------------------------------- one
    # state

    cdef inline int64_t _unpack(self, const uint64_t* state, int variable) noexcept nogil:
        """The value of a variable in a packed state."""
        cdef const int32_t* field = &self.fields[variable, 0]
        cdef uint64_t bits = (state[field[1]] >> field[2]) & ((<uint64_t> 1 << field[3]) - 1)
        return <int64_t> bits + self.lows[variable]

    cdef int expand(self, long long state, const uint64_t* source) noexcept nogil:
        """Append the successors and rows of a state to the batch."""
        cdef const int32_t* field
        cdef long long first = self.successor_count, i
        cdef int v, k, status
        cdef int32_t e
        cdef bint racing = False
        cdef double earned
        for v in range(self.variables):
            self.r[v].i = self._unpack(source, v)
        if not self.grouped and self._open_row():
            return Status.MEMORY
        self.joint_choices = 0
        self.separate = self.grouped
        self.row_action = -1
        self.candidate_count = 0
        self._collect_candidates(self.root)
        self._sort_candidates(0)
        k = self.candidate_count
        for v in range(k):
            e = self.candidates[v]
            if e >= self.markovian and not racing:
                if self.joint_choices:
                    break  # maximal progress: time does not pass where there is a choice
                racing = True
                self.separate = self.kind == Kind.MDP
            if self.event_parts[e + 1] - self.event_parts[e] == 1:
                status = self._expand_single(e, source)
            else:
                status = self._expand_synchronised(e, source)
            if status:
                return status
        if self.successor_count == first:
            return self._add_deadlock_loop(state, source)
        if self.kind == Kind.DTMC and self.joint_choices > 1:
            if self.joint_choices & (self.joint_choices - 1):
                self.rows.shares = True
            for i in range(first, self.successor_count):
                if (<double*> self.weights.data)[i] > self.joint_choices * 5e-324:
                    (<double*> self.weights.data)[i] /= self.joint_choices
            for v in range(self.structures):
                earned = (<double*> self.rows.rewards[v].data)[self.rows.opened - 1]
                if fabs(earned) > self.joint_choices * 5e-324:
                    (<double*> self.rows.rewards[v].data)[self.rows.opened - 1] /= self.joint_choices
        if not self.separate:
            self._end_row(RACE if self.grouped else self.row_action)
        return Status.MEMORY if self.grouped and self.rows.end_group() else 0

    cdef int skip(self) noexcept nogil:
        """Give a state no choices, or an empty row."""
        if self.grouped:
            return Status.MEMORY if self.rows.end_group() else 0
        if self._open_row():
            return Status.MEMORY
        self._end_row(-1)
        return 0

    cdef int stay(self, const uint64_t* source) noexcept nogil:
        """Give a state nothing but a loop."""
        if not self.grouped and self._open_row():
            return Status.MEMORY
        return self._add_loop(source)

    cdef int _add_deadlock_loop(self, long long state, const uint64_t* source) noexcept nogil:
        """A loop in a deadlock."""
        if reserve(&self.deadlocks, (self.deadlock_count + 1) * 8):
            return Status.MEMORY
        (<int64_t*> self.deadlocks.data)[self.deadlock_count] = state
        self.deadlock_count += 1
        return self._add_loop(source)

    cdef int _add_loop(self, const uint64_t* source) noexcept nogil:
        """A loop of probability (rate) 1 without an action."""
        if self._reserve_branches(1) or self.grouped and self._open_row():
            return Status.MEMORY
        memcpy(<uint64_t*> self.targets.data + self.successor_count * self.words, source,
               self.words * 8)
        (<double*> self.weights.data)[self.successor_count] = 1.0
        self.successor_count += 1
        self._end_row(RACE if self.kind == Kind.MA else -1)
        return Status.MEMORY if self.grouped and self.rows.end_group() else 0

    cdef int add_deadlocks(self, Expander other, long long first, long long end) noexcept nogil:
        """Append some deadlocks of another expander."""
        if first == end:
            return 0  # the arrays may be empty
        if reserve(&self.deadlocks, (self.deadlock_count + end - first) * 8):
            return 1
        memcpy(<int64_t*> self.deadlocks.data + self.deadlock_count,
               <const int64_t*> other.deadlocks.data + first, (end - first) * 8)
        self.deadlock_count += end - first
        return 0

    cdef int _open_row(self) noexcept nogil:
        """Open a row, which counts as a choice."""
        return (reserve(&self.ends, (self.row_count + 1) * 8)
                or reserve(&self.distinct, self.row_count + 1) or self.rows.open_row())

    cdef void _end_row(self, int action) noexcept nogil:
        (<int64_t*> self.ends.data)[self.row_count] = self.successor_count
        # A row has several joint choices only if it is the only one of its state.
        (<uint8_t*> self.distinct.data)[self.row_count] = (
            self.is_distinct and (self.separate or self.joint_choices == 1))
        self.rows.set_action(action)
        self.row_count += 1

    cdef int _reserve_branches(self, long long more) noexcept nogil:
        """Make room for so many more branches."""
        return (reserve(&self.targets, (self.successor_count + more) * self.words * 8)
                or reserve(&self.weights, (self.successor_count + more) * 8))

    # ------------------------------------------------------------------------------------
    # candidates

    cdef void _collect_candidates(self, int node) noexcept nogil:
        """Collect the items of a decision tree for the current state.

        Nodes: (0, n, items…) or (1, variable, low, next, children…).
        """
        cdef int i
        cdef int32_t child
        cdef const int32_t* f = &self.forest[0]
        while node >= 0:
            if f[node] == 0:
                for i in range(f[node + 1]):
                    self.candidates[self.candidate_count] = f[node + 2 + i]
                    self.candidate_count += 1
                return
            child = f[node + 4 + <int> (self.r[f[node + 1]].i - f[node + 2])]
            if child >= 0:
                self._collect_candidates(child)
            node = f[node + 3]

    cdef void _sort_candidates(self, int first) noexcept nogil:
        """Sort candidates into the order of the model; they are few and nearly sorted."""
        cdef int i, j
        cdef int32_t item
        for i in range(first + 1, self.candidate_count):
            item = self.candidates[i]
            j = i
            while j > first and self.candidates[j - 1] > item:
                self.candidates[j] = self.candidates[j - 1]
                j -= 1
            self.candidates[j] = item

    # ----------------------------------------------------------------------------------------
    # events

    cdef int _expand_single(self, int32_t event, const uint64_t* source) noexcept nogil:
        """An event with one participant: each enabled command is a choice."""
        cdef int participant = self.event_parts[event], i, count, status
        cdef const int32_t* commands
        commands = self._participant_commands(participant, &count)
        self.part_count = 1
        for i in range(count):
            self.evaluated_count = 0
            status = self._evaluate_command(commands[i], 0)
            if status == Status.DISABLED:
                continue
            if status:
                return status
            self.enabled_begin[0] = 0
            self.enabled_begin[1] = self.evaluated_count
            self.chosen[0] = 0
            status = self._add_joint_choice(event, source)
            if status:
                return status
        return 0

    cdef int _expand_synchronised(self, int32_t event, const uint64_t* source) noexcept nogil:
        """A synchronised event: all combinations of the participants' enabled commands."""
        cdef int first = self.event_parts[event], parts = self.event_parts[event + 1] - first, p, i
        cdef int status
        self.enabled_count = 0
        for p in range(parts):
            self.part_begin[p] = self.enabled_count
            status = self._find_enabled(first + p)
            if status:
                return status
            if self.enabled_count == self.part_begin[p]:
                return 0
        self.part_begin[parts] = self.enabled_count
        self.part_count = parts
        self.evaluated_count = 0
        for i in range(self.enabled_count):
            self.enabled_begin[i] = self.evaluated_count
            status = self._evaluate_command(self.enabled[i], i)
            if status:
                return status
        self.enabled_begin[self.enabled_count] = self.evaluated_count
        for p in range(parts):
            self.chosen[p] = self.part_begin[p]
        while True:
            status = self._add_joint_choice(event, source)
            if status:
                return status
            p = parts - 1
            while p >= 0:
                self.chosen[p] += 1
                if self.chosen[p] < self.part_begin[p + 1]:
                    break
                self.chosen[p] = self.part_begin[p]
                p -= 1
            if p < 0:
                return 0

    cdef const int32_t* _participant_commands(self, int participant, int* count) noexcept nogil:
        """The commands of a participant that may be enabled in the current state."""
        cdef int first = self.candidate_count
        if self.part_forest[participant] < 0:
            count[0] = self.part_commands[participant + 1] - self.part_commands[participant]
            return &self.part_list[self.part_commands[participant]]
        self._collect_candidates(self.part_forest[participant])
        self._sort_candidates(first)
        count[0] = self.candidate_count - first
        self.candidate_count = first
        return self.candidates + first

    cdef inline int _execute(self, int start) noexcept nogil:
        return execute(self.code + start, self.code, self.r, self.decider)

    cdef int _find_enabled(self, int participant) noexcept nogil:
        """Append the enabled commands of a participant to `enabled`."""
        cdef int i, count, status
        cdef const int32_t* commands
        commands = self._participant_commands(participant, &count)
        for i in range(count):
            status = self._execute(self.command_guard[commands[i]])
            if status == Status.DONE:
                self.enabled[self.enabled_count] = commands[i]
                self.enabled_count += 1
            elif status != Status.DISABLED:
                return status
        return 0

    cdef int _evaluate_command(self, int32_t command, int position) noexcept nogil:
        """Evaluate guard, probabilities and new values of a command.

        An update without a value is an error only if the commands that are combined with it are
        possible, which `_add_joint_choice` decides.
        """
        cdef int u, first = self.command_updates[command], end = self.command_updates[command + 1]
        cdef int status = self._execute(self.command_code[command])
        cdef double weight, total = 0.0
        self.enabled_status[position] = 0
        if status:
            return status
        for u in range(first, end):
            weight = self.r[self.update_probability[u]].d
            if not (0 <= weight <= 1.7976931348623157e308):
                return Status.PROBABILITY
            total += weight
        self.enabled_total[position] = total
        for u in range(first, end):
            weight = self.r[self.update_probability[u]].d
            if weight == 0:
                continue
            status = self._evaluate_update(u)
            if status:
                self.enabled_status[position] = status
            self.evaluated_weight[self.evaluated_count] = weight
            self.evaluated_update[self.evaluated_count] = u
            self.evaluated_count += 1
        return 0

    cdef int _evaluate_update(self, int u) noexcept nogil:
        """The new values of an update, packed."""
        cdef int w, a, status
        cdef int32_t variable
        cdef uint64_t bits
        cdef uint64_t* value = self.evaluated_value + self.evaluated_count * self.words
        if self.update_code[u] >= 0:
            status = self._execute(self.update_code[u])
            if status:
                return status
        for w in range(self.words):
            value[w] = self.update_preset[u, w]
        for a in range(self.update_assignments[u], self.update_assignments[u + 1]):
            variable = self.assignment_variable[a]
            bits = <uint64_t> self.r[self.assignment_register[a]].i - <uint64_t> self.lows[variable]
            if bits > self.ranges[variable]:
                return Status.RANGE
            value[self.fields[variable, 1]] |= bits << self.fields[variable, 2]
        return 0

    cdef int _add_joint_choice(self, int32_t event, const uint64_t* source) noexcept nogil:
        """A joint choice: all combinations of the updates of the chosen commands."""
        cdef long long combinations = 1, first = self.successor_count
        cdef double total = 1.0
        cdef int p, status = 0
        for p in range(self.part_count):
            combinations *= self.enabled_begin[self.chosen[p]
                                               + 1] - self.enabled_begin[self.chosen[p]]
            total *= self.enabled_total[self.chosen[p]]
            status = status or self.enabled_status[self.chosen[p]]
        if self.check_sums and event < self.markovian and not (-self.tolerance <= total - 1 <= self.tolerance):
            return Status.SUM
        if combinations == 0:
            return 0
        if status:
            return status
        if self._reserve_branches(combinations):
            return Status.MEMORY
        self._combine_updates(0, 1.0, source)
        if self.successor_count == first:
            return 0
        self.is_distinct = self.orbits is not None and self._updates_differ()
        if self.grouped and (self.separate or self.joint_choices == 0) and self._open_row():
            return Status.MEMORY
        if self.structures:
            status = self._add_rewards(event, first)
            if status:
                return status
        self.row_action = (self.event_action[event] if self.joint_choices == 0
                           or self.row_action == self.event_action[event] else -1)
        self.joint_choices += 1
        if self.separate:
            self._end_row(self.event_action[event])
        return 0

    cdef bint _updates_differ(self) noexcept nogil:
        """Whether all successors of the joint choice are different, as the updates of each chosen
        command assign different values to the same variables.
        """
        cdef int p, i, j, begin, end
        for p in range(self.part_count):
            begin = self.enabled_begin[self.chosen[p]]
            end = self.enabled_begin[self.chosen[p] + 1]
            if end - begin > LINEAR_SCAN_ENTRIES:
                return False
            for i in range(begin, end):
                for j in range(begin, i):
                    if (not rows_equal(&self.update_keep[self.evaluated_update[i], 0],
                                       &self.update_keep[self.evaluated_update[j], 0], self.words)
                            or rows_equal(self.evaluated_value + i * self.words,
                                          self.evaluated_value + j * self.words, self.words)):
                        return False
        return True

    cdef void _combine_updates(self, int participant, double weight,
                               const uint64_t* base) noexcept nogil:
        """Append the products of updates from a participant on."""
        cdef int c = self.chosen[participant], i, w, words = self.words
        cdef bint last = participant == self.part_count - 1
        cdef uint64_t* target = self.level_words + participant * words
        cdef double* weights = <double*> self.weights.data
        cdef double product
        cdef const uint64_t* keep
        cdef const uint64_t* value
        for i in range(self.enabled_begin[c], self.enabled_begin[c + 1]):
            if last:
                target = <uint64_t*> self.targets.data + self.successor_count * words
            keep = &self.update_keep[self.evaluated_update[i], 0]
            value = self.evaluated_value + i * words
            product = weight * self.evaluated_weight[i]
            if product == 0 and weight > 0 and self.evaluated_weight[i] > 0:
                product = 5e-324  # it underflows; the equations refuse subnormal numbers
            for w in range(words):
                target[w] = (base[w] & keep[w]) | value[w]
            if last:
                weights[self.successor_count] = product
                self.successor_count += product > 0
            else:
                self._combine_updates(participant + 1, product, target)

    cdef int _add_rewards(self, int32_t event, long long first) noexcept nogil:
        """Add the rewards of the action, times the total weight of the choice, to the current row.
        """
        cdef int action = self.event_action[event] + 1, k, status
        cdef long long i
        cdef double total = 0.0, reward, earned
        cdef double* row_rewards
        if self.action_rewards[action] == self.action_rewards[action + 1]:
            return 0
        for i in range(first, self.successor_count):
            total += (<double*> self.weights.data)[i]
        for k in range(self.action_rewards[action], self.action_rewards[action + 1]):
            status = self._execute(self.rewards[k, 1])
            if status:
                return status
            row_rewards = <double*> self.rows.rewards[self.rewards[k, 0]].data
            row_rewards += self.rows.opened - 1
            reward = self.r[self.rewards[k, 2]].d
            earned = total * reward
            if earned == 0 and total > 0 and reward != 0:
                earned = 5e-324  # it underflows; the equations refuse subnormal numbers
            row_rewards[0] += earned
            if row_rewards[0] - row_rewards[0] != 0:
                return Status.NOT_A_NUMBER
        return 0
