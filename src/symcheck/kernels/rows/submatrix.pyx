# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Parts of a compressed-row matrix: sums over some columns, and the submatrix of some states.

A matrix is given by indptr (int64[rows+1]), indices (int32[entries]) and data (float64[entries]);
groups: int64[states+1], the rows of each state, or None if each state has one row. States are
chosen by masks (uint8[states]), because lists of their rows would take as much memory as vectors of
values. Every function raises MemoryError when memory ends.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t


cdef int64_t count_rows(const int64_t[::1] groups, const uint8_t[::1] chosen) noexcept nogil:
    """Number of rows of the chosen states."""
    cdef int64_t s
    cdef int64_t total = 0
    for s in range(chosen.shape[0]):
        if chosen[s]:
            total += 1 if groups is None else groups[s + 1] - groups[s]
    return total


def sum_columns(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                const int64_t[::1] groups or None, const uint8_t[::1] chosen,
                const uint8_t[::1] columns, const double[::1] values or None) -> Floats:
    """Sums over some columns, for each row of the chosen states.

    Args:
        chosen: uint8[states]; columns: uint8[columns], the columns to add up.
        values: float64[columns], factors of the entries; None for 1.
    Returns:
        float64[rows of the chosen states], in their order.
    """
    cdef int64_t s, k
    cdef int64_t r, i = 0, last
    cdef double total
    cdef double[::1] out = np.empty(count_rows(groups, chosen))
    cdef bint one_row = groups is None, weighted = values is not None
    with nogil:
        for s in range(chosen.shape[0]):
            if not chosen[s]:
                continue
            r = s if one_row else groups[s]
            last = s + 1 if one_row else groups[s + 1]
            while r < last:
                total = 0.0
                for k in range(indptr[r], indptr[r + 1]):
                    if columns[indices[k]]:
                        total += data[k] * values[indices[k]] if weighted else data[k]
                out[i] = total
                i += 1
                r += 1
    return np.asarray(out)


def select_states(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                  const int64_t[::1] groups or None,
                  const uint8_t[::1] chosen) -> tuple[Int64s, Int32s, Floats]:
    """The submatrix of the chosen states, which are renumbered in their order.

    Returns:
        indptr, indices, data. Apart from these only an int32 per state is allocated.
    """
    cdef int64_t n = chosen.shape[0], s, k
    cdef int64_t r, last, row = 0, entry = 0, size = 0
    cdef bint one_row = groups is None
    cdef int32_t[::1] new_column = np.empty(n, np.int32)
    cdef int64_t[::1] start = np.empty(count_rows(groups, chosen) + 1, np.int64)
    cdef int32_t[::1] out
    cdef double[::1] values
    with nogil:
        for s in range(n):
            new_column[s] = <int32_t>size if chosen[s] else -1
            size += chosen[s]
        start[0] = 0
        for s in range(n):
            if not chosen[s]:
                continue
            r = s if one_row else groups[s]
            last = s + 1 if one_row else groups[s + 1]
            while r < last:
                for k in range(indptr[r], indptr[r + 1]):
                    entry += new_column[indices[k]] >= 0
                row += 1
                start[row] = entry
                r += 1
    out, values = np.empty(entry, np.int32), np.empty(entry)
    entry = 0
    with nogil:
        for s in range(n):
            if not chosen[s]:
                continue
            for k in range(indptr[s if one_row else groups[s]],
                           indptr[s + 1 if one_row else groups[s + 1]]):
                if new_column[indices[k]] >= 0:
                    out[entry] = new_column[indices[k]]
                    values[entry] = data[k]
                    entry += 1
    return np.asarray(start), np.asarray(out), np.asarray(values)
