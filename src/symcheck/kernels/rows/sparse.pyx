# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Loops over compressed rows: transposition, products, selection.

A matrix is given by indptr (int64[rows+1]), indices (int32[entries], the columns) and data
(float64[entries]). Every function raises MemoryError when memory ends.
"""

import numpy as np

from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.portable cimport Sum, add_term, rounded, sum_of


cdef object _transpose(const int64_t[::1] indptr, const int32_t[::1] indices,
                       const double[::1] data, int64_t columns, double[::1] values):
    """Counting sort of the entries by column; `values` is filled if it is not empty."""
    cdef int64_t rows = indptr.shape[0] - 1, entries = indptr[rows], r, k, c, position
    cdef int64_t[::1] start = np.zeros(columns + 2, dtype=np.int64)
    cdef int32_t[::1] out = np.empty(entries, dtype=np.int32)
    cdef bint valued = values is not None
    with nogil:
        for k in range(entries):
            start[indices[k] + 2] += 1
        for c in range(2, columns + 2):
            start[c] += start[c - 1]
        for r in range(rows):
            for k in range(indptr[r], indptr[r + 1]):
                position = start[indices[k] + 1]
                out[position] = <int32_t>r
                if valued:
                    values[position] = data[k]
                start[indices[k] + 1] = position + 1
    return np.asarray(start)[: columns + 1], np.asarray(out)


def transpose(const int64_t[::1] indptr, const int32_t[::1] indices,
              int64_t columns) -> tuple[Int64s, Int32s]:
    """The structure of the transposed matrix, without values.

    Returns:
        column_ptr: int64[columns+1]; column_rows: int32[entries], the rows with an entry in each
        column, ascending.
    """
    return _transpose(indptr, indices, None, columns, None)


def transpose_values(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                     int64_t columns) -> tuple[Int64s, Int32s, Floats]:
    """The transposed matrix: int64[columns+1], int32[entries], float64[entries]."""
    values = np.empty(indptr[indptr.shape[0] - 1])
    return *_transpose(indptr, indices, data, columns, values), values


def multiply(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
             const double[::1] x, double[::1] out):
    """out = A x, for x float64[columns] and out float64[rows]."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k
    cdef double total
    with nogil:
        for r in range(rows):
            total = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                total = total + data[k] * x[indices[k]]
            out[r] = total


def multiply_left(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                  const double[::1] x, double[::1] out):
    """out += x A, for x float64[rows] and out float64[columns]."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k
    with nogil:
        for r in range(rows):
            if x[r] != 0.0:
                for k in range(indptr[r], indptr[r + 1]):
                    out[indices[k]] += x[r] * data[k]


def best_products(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                  groups: Int64s | None, const int32_t[::1] states, const double[::1] x,
                  bint maximise, double[::1] out):
    """The best value of A x among the rows of some states, each of which has a row.

    Args:
        groups: int64[states of the matrix+1], the rows of each state; None: each has one.
        states: int32[k]. x: float64[columns]. out: float64[k].
    """
    cdef const int64_t[::1] group_ptr = indptr if groups is None else groups
    cdef bint grouped = groups is not None
    cdef int64_t i, r, k, first, last
    cdef double total, best
    with nogil:
        for i in range(states.shape[0]):
            first = group_ptr[states[i]] if grouped else states[i]
            last = group_ptr[states[i] + 1] if grouped else first + 1
            best = 0.0
            for r in range(first, last):
                total = 0.0
                for k in range(indptr[r], indptr[r + 1]):
                    total = total + data[k] * x[indices[k]]
                if r == first or (total > best if maximise else total < best):
                    best = total
            out[i] = best


def row_sums(const int64_t[::1] indptr, const double[::1] data) -> Floats:
    """Sum of each row, rounded at most twice in all: float64[rows]."""
    cdef int64_t rows = indptr.shape[0] - 1, r, k
    cdef double[::1] out = np.empty(rows)
    cdef Sum total
    with nogil:
        for r in range(rows):
            total = sum_of(0.0)
            for k in range(indptr[r], indptr[r + 1]):
                total = add_term(total, data[k])
            out[r] = rounded(total)
    return np.asarray(out)


def select(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
           const int64_t[::1] rows, const int32_t[::1] new_column) -> tuple[Int64s, Int32s, Floats]:
    """The chosen rows, restricted to some columns.

    Args:
        rows: int64, the rows to copy, in their new order.
        new_column: int32[columns], the new number of each column; entries of negative ones are
            dropped.
    Returns:
        indptr, indices, data of the new matrix.
    """
    cdef int64_t n = rows.shape[0], i, r, k, total = 0
    cdef int64_t[::1] start = np.empty(n + 1, dtype=np.int64)
    with nogil:
        start[0] = 0
        for i in range(n):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                if new_column[indices[k]] >= 0:
                    total += 1
            start[i + 1] = total
    cdef int32_t[::1] out = np.empty(total, dtype=np.int32)
    cdef double[::1] values = np.empty(total)
    with nogil:
        total = 0
        for i in range(n):
            r = rows[i]
            for k in range(indptr[r], indptr[r + 1]):
                if new_column[indices[k]] >= 0:
                    out[total] = new_column[indices[k]]
                    values[total] = data[k]
                    total += 1
    return np.asarray(start), np.asarray(out), np.asarray(values)


def merge_columns_in_place(int64_t[::1] indptr, int32_t[::1] indices, double[::1] data,
                           const int32_t[::1] new_column, int64_t columns) -> int:
    """Renumber the columns and add up the entries of a row that get the same column, in place.

    Args:
        indptr, indices, data: compressed rows, which are overwritten.
        new_column: int32, the new number of each column; entries of negative ones are dropped.
        columns: number of new columns.
    Returns:
        The number of entries that are left; the arrays keep their lengths.
    """
    cdef int64_t rows = indptr.shape[0] - 1, r, k, begin, end = 0, first, total = 0
    cdef int32_t c
    cdef int64_t[::1] entry_of = np.full(columns, -1, dtype=np.int64)
    with nogil:
        for r in range(rows):
            first = total
            begin, end = end, indptr[r + 1]
            for k in range(begin, end):
                c = new_column[indices[k]]
                if c < 0:
                    continue
                if entry_of[c] >= first:
                    data[entry_of[c]] += data[k]
                else:
                    entry_of[c] = total
                    indices[total] = c
                    data[total] = data[k]
                    total += 1
            indptr[r + 1] = total
    return total


def merge_columns(indptr: Int64s, indices: Int32s, data: Floats, const int32_t[::1] new_column,
                  int64_t columns) -> tuple[Int64s, Int32s, Floats]:
    """The matrix after `merge_columns_in_place`, in new arrays."""
    start, out, values = np.array(indptr), np.array(indices), np.array(data)
    total = merge_columns_in_place(start, out, values, new_column, columns)
    return start, out[:total].copy(), values[:total].copy()


def triangular_order(const int64_t[::1] state_ptr, const int32_t[::1] indices,
                     const uint8_t[::1] within=None) -> int:
    """Whether every edge s → t between different states goes up, or every one goes down.

    Args:
        state_ptr: int64[states+1], the entries of each state in `indices`.
        within: uint8[states], the states whose mutual edges count; None for all.
    Returns:
        1 if t > s for every edge, -1 if t < s for every edge, 2 if there are none, 0 otherwise.
    """
    cdef int64_t n = state_ptr.shape[0] - 1, s, k
    cdef bint ascending = True, descending = True, all_states = within is None
    with nogil:
        for s in range(n):
            if not (all_states or within[s]):
                continue
            for k in range(state_ptr[s], state_ptr[s + 1]):
                if indices[k] == s or not (all_states or within[indices[k]]):
                    continue
                if indices[k] > s:
                    descending = False
                else:
                    ascending = False
            if not (ascending or descending):
                break
    if ascending and descending:
        return 2
    return 1 if ascending else -1 if descending else 0
