# cython: language_level=3
"""Successors of packed states: see successors.pyx."""

cimport cython
from libc.stdint cimport int32_t, int64_t, uint64_t

from symcheck.kernels.rows.csr_builder cimport CsrBuilder
from symcheck.kernels.memory cimport Buffer
from symcheck.kernels.explore.register_machine cimport Instruction, Register


@cython.final
cdef class Expander:
    cdef object tables
    cdef readonly CsrBuilder rows
    # the model
    cdef int kind, words, variables, structures
    cdef bint check_sums
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
    # scratch of one state
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
    # scratch of one batch
    cdef Buffer targets, weights, ends, deadlocks
    cdef long long successor_count, row_count, deadlock_count

    cdef void clear(self) noexcept nogil
    cdef int expand(self, long long state, const uint64_t* source) noexcept nogil
    cdef int _add_deadlock_loop(self, long long state, const uint64_t* source) noexcept nogil
    cdef int _open_row(self) noexcept nogil
    cdef void _end_row(self, int action) noexcept nogil
    cdef int _reserve_branches(self, long long more) noexcept nogil
    cdef void _collect_candidates(self, int node) noexcept nogil
    cdef void _sort_candidates(self, int first) noexcept nogil
    cdef int _expand_single(self, int32_t event, const uint64_t* source) noexcept nogil
    cdef int _expand_synchronised(self, int32_t event, const uint64_t* source) noexcept nogil
    cdef const int32_t* _participant_commands(self, int participant, int* count) noexcept nogil
    cdef inline int64_t _unpack(self, const uint64_t* state, int variable) noexcept nogil
    cdef int _find_enabled(self, int participant) noexcept nogil
    cdef int _evaluate_command(self, int32_t command, int position) noexcept nogil
    cdef int _evaluate_update(self, int u) noexcept nogil
    cdef int _add_joint_choice(self, int32_t event, const uint64_t* source) noexcept nogil
    cdef void _combine_updates(self, int participant, double weight,
                               const uint64_t* base) noexcept nogil
    cdef int _add_rewards(self, int32_t event, long long first) noexcept nogil
