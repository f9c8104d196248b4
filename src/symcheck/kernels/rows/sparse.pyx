# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Loops over compressed rows: transpose, products, selections."""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t


def transpose(const int64_t[::1] indptr, const int32_t[::1] indices, int64_t columns):
    """Row numbers per column, ascending: (int64[columns+1], int32[entries]). A counting sort; no values."""
    cdef int64_t rows = indptr.shape[0] - 1, entries = indptr[rows], r, k, c
    cdef int64_t[::1] start = np.zeros(columns + 2, dtype=np.int64)
    cdef int32_t[::1] out = np.empty(entries, dtype=np.int32)
    with nogil:
        for k in range(entries):
            start[indices[k] + 2] += 1
        for c in range(2, columns + 2):
            start[c] += start[c - 1]
        for r in range(rows):
            for k in range(indptr[r], indptr[r + 1]):
                out[start[indices[k] + 1]] = <int32_t>r
                start[indices[k] + 1] += 1
    return np.asarray(start)[: columns + 1], np.asarray(out)


def transpose_values(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, int64_t columns):
    """The transposed matrix with values: (int64[columns+1], int32[entries], float64[entries])."""
    cdef int64_t rows = indptr.shape[0] - 1, entries = indptr[rows], r, k, c, p
    cdef int64_t[::1] start = np.zeros(columns + 2, dtype=np.int64)
    cdef int32_t[::1] out = np.empty(entries, dtype=np.int32)
    cdef double[::1] values = np.empty(entries)
    with nogil:
        for k in range(entries):
            start[indices[k] + 2] += 1
        for c in range(2, columns + 2):
            start[c] += start[c - 1]
        for r in range(rows):
            for k in range(indptr[r], indptr[r + 1]):
                p = start[indices[k] + 1]
                out[p] = <int32_t>r
                values[p] = data[k]
                start[indices[k] + 1] = p + 1
    return np.asarray(start)[: columns + 1], np.asarray(out), np.asarray(values)


def multiply(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const double[::1] x, double[::1] out):
    """out = A x."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k
    cdef double total
    with nogil:
        for r in range(rows):
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                total = total + data[k] * x[indices[k]]
            out[r] = total


def row_sums(const int64_t[::1] indptr, const double[::1] data):
    """Sum of each row, accurately rounded (long double)."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k
    cdef double[::1] out = np.empty(rows)
    cdef long double total
    with nogil:
        for r in range(rows):
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                total = total + data[k]
            out[r] = <double>total
    return np.asarray(out)


def select(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
           const int64_t[::1] rows, const int32_t[::1] place):
    """The chosen rows, with only the columns c where place[c] >= 0, renumbered to place[c]. Arrays of the new matrix."""
    cdef int64_t n = rows.shape[0], i, r, k, total = 0
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    with nogil:
        start[0] = 0
        for i in range(n):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                if place[indices[k]] >= 0:
                    total += 1
            start[i + 1] = total
    cdef int32_t[::1] out = np.empty(total, dtype=np.int32)
    cdef double[::1] values = np.empty(total)
    with nogil:
        total = 0
        for i in range(n):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                if place[indices[k]] >= 0:
                    out[total] = place[indices[k]]
                    values[total] = data[k]
                    total += 1
    return np.asarray(start), np.asarray(out), np.asarray(values)


def merge(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const int32_t[::1] place, int64_t columns):
    """Renumber columns by `place` (many to one; negative: dropped) and add up what falls together, row by row."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k, first, total = 0
    cdef int32_t c
    cdef int64_t[::1] seen = np.full(columns, -1, dtype=np.int64)
    cdef int64_t[::1] start = np.empty(rows + 1, dtype=np.int64)
    cdef int32_t[::1] out = np.empty(indptr[rows], dtype=np.int32)
    cdef double[::1] values = np.empty(indptr[rows])
    with nogil:
        start[0] = 0
        for r in range(rows):
            first = total
            for k in range(indptr[r], indptr[r + 1]):
                c = place[indices[k]]
                if c < 0:
                    continue
                if seen[c] >= first:
                    values[seen[c]] += data[k]
                else:
                    seen[c] = total
                    out[total] = c
                    values[total] = data[k]
                    total += 1
            start[r + 1] = total
    return np.asarray(start), np.asarray(out)[:total].copy(), np.asarray(values)[:total].copy()


def triangular(const int64_t[::1] edges, const int32_t[::1] indices, const uint8_t[::1] within=None):
    """1 if every edge s → t has t > s (self-loops allowed), -1 if every edge has t < s, 0 otherwise (2: no edges but loops).

    within: uint8[states], the states whose edges to one another count; None for all.
    """
    cdef int64_t n = edges.shape[0] - 1, s, k
    cdef bint up = True, down = True, everywhere = within is None
    with nogil:
        for s in range(n):
            if not (everywhere or within[s]):
                continue
            for k in range(edges[s], edges[s + 1]):
                if indices[k] == s or not (everywhere or within[indices[k]]):
                    continue
                if indices[k] > s:
                    down = False
                else:
                    up = False
            if not (up or down):
                break
    if up and down:
        return 2
    return 1 if up else -1 if down else 0
