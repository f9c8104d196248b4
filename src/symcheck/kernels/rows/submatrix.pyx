# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Chosen rows of a compressed-row matrix: sums over chosen columns, and the matrix among chosen states.

States are chosen by masks (uint8 per state), since lists of their rows would take as much memory as vectors of values.
"""

import numpy as np

ctypedef unsigned char uint8


def sum_into(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] rows,
             const uint8[::1] member, double[::1] out):
    """Per chosen row: the sum of the entries whose column is a member."""
    cdef Py_ssize_t i, k
    cdef long long r
    cdef double total
    with nogil:
        for i in range(rows.shape[0]):
            r = rows[i]
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                if member[indices[k]]:
                    total += data[k]
            out[i] = total


cdef long long count_rows(const long long[::1] groups, const uint8[::1] chosen) noexcept nogil:
    """How many rows the chosen states have. `groups` is None where each has one."""
    cdef Py_ssize_t s
    cdef long long total = 0
    for s in range(chosen.shape[0]):
        if chosen[s]:
            total += 1 if groups is None else groups[s + 1] - groups[s]
    return total


def sum_among(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] groups,
              const uint8[::1] chosen, const uint8[::1] member, const double[::1] values):
    """Per row of the chosen states, in their order: the sum over the entries whose column is a member, of the entry, or of
    entry times value where `values` (or None) are given. float64[rows of the chosen]."""
    cdef Py_ssize_t s, k
    cdef long long r, i = 0, last
    cdef double total
    cdef double[::1] out = np.empty(count_rows(groups, chosen))
    cdef bint plain = groups is None, weighted = values is not None
    with nogil:
        for s in range(chosen.shape[0]):
            if not chosen[s]:
                continue
            r = s if plain else groups[s]
            last = s + 1 if plain else groups[s + 1]
            while r < last:
                total = 0.0
                for k in range(indptr[r], indptr[r + 1]):
                    if member[indices[k]]:
                        total += data[k] * values[indices[k]] if weighted else data[k]
                out[i] = total
                i += 1
                r += 1
    return np.asarray(out)


def take_rows(const double[::1] rows, const long long[::1] groups, const uint8[::1] chosen):
    """The values that belong to rows of the chosen states: float64[rows of the chosen]."""
    cdef Py_ssize_t s
    cdef long long r, i = 0
    cdef double[::1] out = np.empty(count_rows(groups, chosen))
    with nogil:
        for s in range(chosen.shape[0]):
            if chosen[s]:
                for r in range(groups[s], groups[s + 1]):
                    out[i] = rows[r]
                    i += 1
    return np.asarray(out)


def groups_among(const long long[::1] groups, const uint8[::1] chosen):
    """Where the rows of each chosen state begin, counted among the rows of the chosen: int64[chosen+1]."""
    cdef Py_ssize_t s
    cdef long long i = 0
    cdef long long[::1] out = np.empty(np.count_nonzero(chosen) + 1, np.int64)
    out[0] = 0
    with nogil:
        for s in range(chosen.shape[0]):
            if chosen[s]:
                out[i + 1] = out[i] + groups[s + 1] - groups[s]
                i += 1
    return np.asarray(out)


def select_states(const long long[::1] indptr, const int[::1] indices, const double[::1] data, const long long[::1] groups,
                  const uint8[::1] chosen):
    """The matrix among the chosen states, which are renumbered in their order: (indptr int64, indices int32, data float64).

    Nothing but these, and a number per state, is allocated.
    """
    cdef Py_ssize_t n = chosen.shape[0], s, k
    cdef long long r, last, row = 0, entry = 0, size = 0
    cdef bint plain = groups is None
    cdef int[::1] place = np.empty(n, np.int32)
    cdef long long[::1] start = np.empty(count_rows(groups, chosen) + 1, np.int64)
    cdef int[::1] out
    cdef double[::1] values
    with nogil:
        for s in range(n):
            place[s] = <int> size if chosen[s] else -1
            size += chosen[s]
        start[0] = 0
        for s in range(n):
            if not chosen[s]:
                continue
            r = s if plain else groups[s]
            last = s + 1 if plain else groups[s + 1]
            while r < last:
                for k in range(indptr[r], indptr[r + 1]):
                    entry += place[indices[k]] >= 0
                row += 1
                start[row] = entry
                r += 1
    out, values = np.empty(entry, np.int32), np.empty(entry)
    entry = 0
    with nogil:
        for s in range(n):
            if not chosen[s]:
                continue
            for k in range(indptr[s if plain else groups[s]], indptr[s + 1 if plain else groups[s + 1]]):
                if place[indices[k]] >= 0:
                    out[entry] = place[indices[k]]
                    values[entry] = data[k]
                    entry += 1
    return np.asarray(start), np.asarray(out), np.asarray(values)
