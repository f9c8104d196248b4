# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Pairs of a state and an automaton's state: pair (s, q) has the place s * size + q."""

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.memory cimport Buffer, release, reserve


def reach(const int64_t[::1] edges, const int32_t[::1] indices, const int32_t[:, ::1] table, const int32_t[::1] letter,
          int64_t initial, uint8_t[::1] found):
    """Mark (in uint8[states * size], zeros at first) the pairs reachable from (s, initial) for some s.

    edges: int64[states+1], the entries of each state. From (s, q) the automaton goes to table[q, letter[s]].
    """
    cdef int64_t states = edges.shape[0] - 1, size = table.shape[0], begin, s, q, k, place, top = 0
    cdef Buffer stack
    cdef bint failed = False
    stack.data = NULL
    stack.size = 0
    with nogil:
        for begin in range(states):
            place = begin * size + initial
            if found[place]:
                continue
            found[place] = 1
            if reserve(&stack, 8):
                failed = True
                break
            (<int64_t*> stack.data)[0] = place
            top = 1
            while top > 0:
                top -= 1
                place = (<int64_t*> stack.data)[top]
                s = place // size
                q = table[place - s * size, letter[s]]
                if reserve(&stack, (top + edges[s + 1] - edges[s]) * 8):
                    failed = True
                    break
                for k in range(edges[s], edges[s + 1]):
                    place = indices[k] * size + q
                    if not found[place]:
                        found[place] = 1
                        (<int64_t*> stack.data)[top] = place
                        top += 1
            if failed:
                break
    release(&stack)
    if failed:
        raise MemoryError


def split(const uint8_t[::1] found, int64_t size, int32_t[::1] state, int32_t[::1] automaton, int32_t[::1] number):
    """Number the marked places in ascending order: their parts, and the number at each place (-1 where not marked)."""
    cdef int64_t place, count = 0
    with nogil:
        for place in range(found.shape[0]):
            number[place] = -1
            if found[place]:
                state[count] = <int32_t> (place // size)
                automaton[count] = <int32_t> (place % size)
                number[place] = <int32_t> count
                count += 1


def rows(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const int64_t[::1] chosen,
         const int32_t[::1] following, const int32_t[::1] number, int64_t size, const int64_t[::1] out_indptr,
         int32_t[::1] out_indices, double[::1] out_data):
    """Write the row `chosen[i]` (int64[rows]) for each i, each of its columns c as the pair (c, following[i])."""
    cdef int64_t i, k, at
    with nogil:
        for i in range(chosen.shape[0]):
            at = out_indptr[i]
            for k in range(indptr[chosen[i]], indptr[chosen[i] + 1]):
                out_indices[at] = number[indices[k] * size + following[i]]
                out_data[at] = data[k]
                at += 1


def matching(const int32_t[::1] state, const int32_t[::1] automaton, const int32_t[::1] letter, const uint8_t[:, ::1] wanted,
             uint8_t[::1] out):
    """For each pair (s, q): wanted[q, letter[s]]."""
    cdef int64_t i
    with nogil:
        for i in range(state.shape[0]):
            out[i] = wanted[automaton[i], letter[state[i]]]
