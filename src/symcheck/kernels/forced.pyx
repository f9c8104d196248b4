# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Loops over states that have one way on: where that leads in the end, and rows in terms of what is left.

`place` holds a number per state: p >= 0 is where the state ends; -1 - s says that its only transition leads to state s.
"""

import numpy as np

from libc.stdint cimport INT32_MIN, int32_t, int64_t
from libc.stdlib cimport free, realloc


def follow(int32_t[::1] place, int32_t never):
    """Replace successors by where they lead in the end, in place; `never` for states that go round in circles. Linear time."""
    cdef int64_t n = place.shape[0], s, depth, room = 0
    cdef int32_t t, end
    cdef int32_t* path = NULL
    cdef int32_t* wider
    cdef bint full = False
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
