# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Backward search and attractors; on a part of a model, it goes on when other parts reach states.

States own consecutive rows (choices); column_ptr, column_rows are the transposed structure, and
row_state is the state of each row (see `symcheck.kernels.graph.mdp_graph`).
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t


def search(const int64_t[::1] column_ptr, const int32_t[::1] column_rows,
           const int32_t[::1] row_state, uint8_t[::1] hit, misses: Int32s | None,
           const uint8_t[::1] through, const int32_t[::1] found, uint8_t[::1] reached,
           witness: Int64s | None = None):
    """Extend the reached states by the states of `through` that lead to new ones.

    Args:
        hit: uint8[rows], the rows with a reached successor, and rows that do not count.
        misses: int32[states], the rows of each state that are not hit, all of which must be; None:
            one hit row is enough.
        through: uint8[states].
        found: int32[k], states that were reached since the last call.
        reached: uint8[states], with the states of `found`; extended.
        witness: int64[states], receives the last hit row of each state that is reached; None: it is
            not asked for.
    """
    cdef int32_t[::1] left
    cdef int64_t[::1] rows = witness
    cdef bint noted = witness is not None
    cdef bint every = misses is not None
    cdef int64_t head = 0, tail = found.shape[0], k, r
    cdef int32_t s, p
    cdef int32_t[::1] queue = np.empty(reached.shape[0] + tail, dtype=np.int32)
    if every:
        left = misses
    queue[:tail] = found
    with nogil:
        while head < tail:
            s = queue[head]
            head += 1
            for k in range(column_ptr[s], column_ptr[s + 1]):
                r = column_rows[k]
                if hit[r]:
                    continue
                hit[r] = 1
                p = row_state[r]
                if every:
                    left[p] -= 1
                    if left[p] > 0:
                        continue
                if through[p] and not reached[p]:
                    reached[p] = 1
                    if noted:
                        rows[p] = r
                    queue[tail] = p
                    tail += 1
