# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Ranks of states, which some transition of each row lowers."""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t


def descending_ranks(const int64_t[::1] pre, const int32_t[::1] rows_in,
                     const int32_t[::1] owner, const uint8_t[::1] rows,
                     const uint8_t[::1] ends, bint all_rows) -> tuple[Int64s, Int64s]:
    """The rank of each state, -1 for none, and a row that lowers it, -1 for none.

    The search goes backward from the states of rank 0, level by level.

    Args:
        pre, rows_in: the rows that may enter each state, as compressed rows.
        owner: int32[rows], the state of each row.
        rows: uint8[rows], the rows that are considered.
        ends: uint8[n], the states of rank 0.
        all_rows: whether all considered rows of a state have to lower its rank; otherwise one.
    """
    cdef int64_t n = ends.shape[0], k, head = 0, tail = 0
    cdef int32_t state, source, row
    cdef int64_t[::1] ranks = np.full(n, -1, np.int64), towards = np.full(n, -1, np.int64)
    cdef int32_t[::1] queue = np.empty(n, np.int32), left = np.ones(n, np.int32)
    cdef uint8_t[::1] seen = np.zeros(rows.shape[0], np.uint8)
    with nogil:
        if all_rows:
            left[:] = 0
            for k in range(rows.shape[0]):
                left[owner[k]] += rows[k] != 0
        for k in range(n):
            if ends[k]:
                ranks[k] = 0
                queue[tail] = k
                tail += 1
        while head < tail:
            state = queue[head]
            head += 1
            for k in range(pre[state], pre[state + 1]):
                row = rows_in[k]
                source = owner[row]
                if not rows[row] or seen[row] or ranks[source] >= 0:
                    continue
                seen[row] = True
                if towards[source] < 0:
                    towards[source] = row
                left[source] -= 1
                if left[source] == 0:
                    ranks[source] = ranks[state] + 1
                    queue[tail] = source
                    tail += 1
    return np.asarray(ranks), np.where(np.asarray(ranks) > 0, towards, -1)
