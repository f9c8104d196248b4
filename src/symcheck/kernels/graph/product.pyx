# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""The product of a model and a deterministic automaton.

The pair of state s and automaton state q has the number s * size + q, where `size` is the number of
states of the automaton.
"""

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.memory cimport Buffer, release, reserve


def mark_reachable(const int64_t[::1] state_ptr, const int32_t[::1] indices,
                   const int32_t[:, ::1] transitions, const int32_t[::1] letters, int64_t initial,
                   uint8_t[::1] marked):
    """Mark the pairs that are reachable from (s, initial) for some state s.

    Args:
        state_ptr, indices: int64[states+1] and int32, the successors of each state.
        transitions: int32[size, letters], the automaton goes from q to transitions[q, letters[s]].
        letters: int32[states], the letter of each state.
        initial: the initial state of the automaton.
        marked: uint8[states * size], zeros at first.
    Raises:
        MemoryError: memory ended.
    """
    cdef int64_t states = state_ptr.shape[0] - 1, size = transitions.shape[0], first, s, q, k, pair
    cdef int64_t top = 0
    cdef Buffer stack = Buffer(NULL, 0, 0)
    cdef bint failed = False
    with nogil:
        for first in range(states):
            pair = first * size + initial
            if marked[pair]:
                continue
            marked[pair] = 1
            if reserve(&stack, 8):
                failed = True
                break
            (<int64_t*> stack.data)[0] = pair
            top = 1
            while top > 0:
                top -= 1
                pair = (<int64_t*> stack.data)[top]
                s = pair // size
                q = transitions[pair - s * size, letters[s]]
                if reserve(&stack, (top + state_ptr[s + 1] - state_ptr[s]) * 8):
                    failed = True
                    break
                for k in range(state_ptr[s], state_ptr[s + 1]):
                    pair = indices[k] * size + q
                    if not marked[pair]:
                        marked[pair] = 1
                        (<int64_t*> stack.data)[top] = pair
                        top += 1
            if failed:
                break
    release(&stack)
    if failed:
        raise MemoryError


def number_pairs(const uint8_t[::1] marked, int64_t size, int32_t[::1] state,
                 int32_t[::1] automaton, int32_t[::1] pair_number):
    """Number the marked pairs in ascending order.

    Args:
        marked: uint8[states * size].
        state, automaton: int32[count], receive the parts of each pair.
        pair_number: int32[states * size], receives the number of each pair, -1 if it is not marked.
    """
    cdef int64_t pair, count = 0
    with nogil:
        for pair in range(marked.shape[0]):
            pair_number[pair] = -1
            if marked[pair]:
                state[count] = <int32_t> (pair // size)
                automaton[count] = <int32_t> (pair % size)
                pair_number[pair] = <int32_t> count
                count += 1


def product_rows(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                 const int64_t[::1] base_rows, const int32_t[::1] next_automaton_state,
                 const int32_t[::1] pair_number, int64_t size, const int64_t[::1] out_indptr,
                 int32_t[::1] out_indices, double[::1] out_data):
    """Write the rows of the product.

    Args:
        indptr, indices, data: compressed rows of the model.
        base_rows: int64[rows], the row of the model that each row of the product copies.
        next_automaton_state: int32[rows], the automaton state after the step.
        pair_number: int32[states * size], the number of each pair.
        out_indptr: int64[rows+1]; out_indices, out_data: int32 and float64[out_indptr[rows]].
    """
    cdef int64_t i, k, at
    with nogil:
        for i in range(base_rows.shape[0]):
            at = out_indptr[i]
            for k in range(indptr[base_rows[i]], indptr[base_rows[i] + 1]):
                out_indices[at] = pair_number[indices[k] * size + next_automaton_state[i]]
                out_data[at] = data[k]
                at += 1
