# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Loops over states that have one way on: where that leads in the end, and rows in terms of what is left.

`place` holds a number per state: p >= 0 is where the state ends; -1 - s says that its only transition leads to state s.
"""

import numpy as np

from libc.stdint cimport INT32_MIN, int32_t, int64_t, uint8_t
from libc.stdlib cimport free, realloc


def follow(int32_t[::1] place, int32_t never, double[::1] along=None):
    """Replace successors by where they lead in the end, in place; `never` for states that go round in circles. Linear time.

    along: what each state earns with its step (0 where it has a place); becomes the sum along its way.
    """
    cdef int64_t n = place.shape[0], s, depth, room = 0
    cdef int32_t t, end
    cdef int32_t* path = NULL
    cdef int32_t* wider
    cdef bint full = False, adding = along is not None
    with nogil:
        for s in range(n):
            if place[s] >= 0:
                continue
            depth = 0
            t = <int32_t>s
            # A state on the path is marked: its successor stands behind it there.
            while place[t] < 0 and place[t] != INT32_MIN:
                if depth == room:
                    room = 2 * room + 1024
                    wider = <int32_t*>realloc(path, room * sizeof(int32_t))
                    if wider is NULL:
                        full = True
                        break
                    path = wider
                path[depth] = t
                depth += 1
                end = place[t]
                place[t] = INT32_MIN
                t = -1 - end
            if full:
                break
            end = never if place[t] == INT32_MIN else place[t]
            while depth:
                depth -= 1
                place[path[depth]] = end
                if adding and end != never:
                    along[path[depth]] += along[t]
                t = path[depth]
        free(path)
    if full:
        raise MemoryError


def merge(int64_t[::1] indptr, int32_t[::1] indices, double[::1] data, const int32_t[::1] place, int64_t columns):
    """Renumber columns by `place` (many to one) and add up what falls together, row by row, in place; the entries that are left."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k, begin, end = 0, first, total = 0
    cdef int32_t c
    cdef int64_t[::1] seen = np.full(columns, -1, dtype=np.int64)
    with nogil:
        for r in range(rows):
            first = total
            begin, end = end, indptr[r + 1]
            for k in range(begin, end):
                c = place[indices[k]]
                if seen[c] >= first:
                    data[seen[c]] += data[k]
                else:
                    seen[c] = total
                    indices[total] = c
                    data[total] = data[k]
                    total += 1
            indptr[r + 1] = total
    return total


def unknowns(int64_t[::1] indptr, int32_t[::1] indices, double[::1] data, const int64_t[::1] groups,
             const uint8_t[::1] member, const int32_t[::1] place, int64_t n):
    """The rows of the n states with place[s] >= 0, in terms of each other; written over the old rows, of which nothing is left.

    Returns (groups int64[n+1], into, leave float64[rows], entries): per row, what enters states that are members and no unknowns,
    and what leaves the unknowns. The new rows are the first of indptr, indices and data.
    """
    cdef int64_t states = groups.shape[0] - 1, s, r, k, begin, end = 0, rows = 0, row = 0, state = 0, total = 0
    cdef int32_t c
    cdef double entering, leaving
    for s in range(states):
        if place[s] >= 0:
            rows += groups[s + 1] - groups[s]
    cdef int64_t[::1] new_groups = np.empty(n + 1, dtype=np.int64)
    cdef double[::1] into = np.empty(rows)
    cdef double[::1] leave = np.empty(rows)
    with nogil:
        new_groups[0] = 0
        for s in range(states):
            if place[s] < 0:
                continue
            # What has been written over is where this row begins at most, and only if all rows before were taken.
            begin = end if groups[s] == row else indptr[groups[s]]
            for r in range(groups[s], groups[s + 1]):
                end = indptr[r + 1]
                entering = leaving = 0.0
                for k in range(begin, end):
                    c = indices[k]
                    if place[c] >= 0:
                        indices[total] = place[c]
                        data[total] = data[k]
                        total += 1
                    else:
                        leaving = leaving + data[k]
                        if member[c]:
                            entering = entering + data[k]
                begin = end
                into[row] = entering
                leave[row] = leaving
                row += 1
                indptr[row] = total
            state += 1
            new_groups[state] = row
        indptr[0] = 0
    return np.asarray(new_groups), np.asarray(into), np.asarray(leave), total
