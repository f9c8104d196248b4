# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Deterministic-state elimination: states whose only choice has a single successor.

Such a state has the value of its successor (plus the reward of the step), so it can be eliminated.
`representative` (int32[n]) holds a number per state: p >= 0 is the representative of the state, and
-1 - s says that its only transition leads to state s.
"""

import numpy as np

from libc.stdint cimport INT32_MIN, int32_t, int64_t, uint8_t
from libc.stdlib cimport free, realloc


def resolve_representatives(int32_t[::1] representative, int32_t sink,
                            double[::1] path_reward=None):
    """Replace successors by the representatives that they lead to, in place and in linear time.

    Args:
        representative: int32[n], as the module says; all entries are >= 0 afterwards.
        sink: the representative of states on cycles of deterministic states.
        path_reward: float64[n] or None. It holds the reward of each state's step (0 for states with
            a representative), and afterwards the sum along the path to the representative.
    Raises:
        MemoryError: memory ended; the arrays are then useless.
    """
    cdef int64_t n = representative.shape[0], s, depth, capacity = 0
    cdef int32_t t, last
    cdef int32_t* path = NULL
    cdef int32_t* larger
    cdef bint failed = False, rewarded = path_reward is not None
    with nogil:
        for s in range(n):
            if representative[s] >= 0:
                continue
            depth = 0
            t = <int32_t>s
            # A state on the path is marked; its successor follows it there.
            while representative[t] < 0 and representative[t] != INT32_MIN:
                if depth == capacity:
                    capacity = 2 * capacity + 1024
                    larger = <int32_t*>realloc(path, capacity * sizeof(int32_t))
                    if larger is NULL:
                        failed = True
                        break
                    path = larger
                path[depth] = t
                depth += 1
                last = representative[t]
                representative[t] = INT32_MIN
                t = -1 - last
            if failed:
                break
            last = sink if representative[t] == INT32_MIN else representative[t]
            while depth:
                depth -= 1
                representative[path[depth]] = last
                if rewarded and last != sink:
                    path_reward[path[depth]] += path_reward[t]
                t = path[depth]
        free(path)
    if failed:
        raise MemoryError


def restrict_in_place(int64_t[::1] indptr, int32_t[::1] indices, double[::1] data,
                      const int64_t[::1] groups, const uint8_t[::1] target,
                      const int32_t[::1] column, int64_t n) -> tuple[Int64s, Floats, Floats, int]:
    """Restrict a matrix to the rows and columns of the unknown states, in its own arrays.

    Args:
        indptr, indices, data: compressed rows (int64[rows+1], int32, float64); they are overwritten
            by the new rows, which are their first elements.
        groups: int64[states+1], the rows of each state.
        target: uint8[columns], the columns whose mass is reported.
        column: int32[columns], the new number of each unknown state, -1 for all others.
        n: number of unknown states.
    Returns:
        groups: int64[n+1], the new rows of each unknown state.
        entering_mass: float64[rows], per new row the sum of entries in target columns that are not
            unknown.
        exit_mass: float64[rows], per new row the sum of entries in columns that are not unknown.
        entries: number of entries left.
    """
    cdef int64_t states = groups.shape[0] - 1, s, r, k, begin, end = 0, rows = 0, row = 0
    cdef int64_t state = 0, total = 0
    cdef int32_t c
    cdef double into_target, outside
    for s in range(states):
        if column[s] >= 0:
            rows += groups[s + 1] - groups[s]
    cdef int64_t[::1] new_groups = np.empty(n + 1, dtype=np.int64)
    cdef double[::1] entering_mass = np.empty(rows)
    cdef double[::1] exit_mass = np.empty(rows)
    with nogil:
        new_groups[0] = 0
        for s in range(states):
            if column[s] < 0:
                continue
            # The start of this row was overwritten only if all rows before it were taken.
            begin = end if groups[s] == row else indptr[groups[s]]
            for r in range(groups[s], groups[s + 1]):
                end = indptr[r + 1]
                into_target = outside = 0.0
                for k in range(begin, end):
                    c = indices[k]
                    if column[c] >= 0:
                        indices[total] = column[c]
                        data[total] = data[k]
                        total += 1
                    else:
                        outside = outside + data[k]
                        if target[c]:
                            into_target = into_target + data[k]
                begin = end
                entering_mass[row] = into_target
                exit_mass[row] = outside
                row += 1
                indptr[row] = total
            state += 1
            new_groups[state] = row
        indptr[0] = 0
    return np.asarray(new_groups), np.asarray(entering_mass), np.asarray(exit_mass), total
