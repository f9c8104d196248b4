# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""I - A = K1 + K2 - I, with K1 the lower and K2 the upper triangle, and products with K1^-1 (I - A) K2^-1.

A = diag(scale) R, where R is without its loops: its values are stored as codes into a table where few of them differ. One
solution with K1 and one with K2 make a product (Eisenstat 1981), and what BiCGStab does with vectors is done on the way.
"""

import numpy as np

from libc.math cimport fabs
from libc.stdint cimport int32_t, int64_t, uint8_t, uint16_t, uint64_t
from libc.string cimport memcpy

cdef enum:
    SLOTS = 1 << 18       # of the table of values: four times what codes can tell apart

ctypedef fused Value:
    uint8_t
    uint16_t
    double


cdef inline int64_t _slot(double value, const int32_t* slot, const double* table) noexcept nogil:
    """Where a value is, or where it goes. Values are not compared by their bits: there must be no negative zero."""
    cdef uint64_t bits, h
    memcpy(&bits, &value, 8)
    h = (((bits ^ (bits >> 29)) * <uint64_t>0x9E3779B97F4A7C15) >> 40) & (SLOTS - 1)
    while slot[h] >= 0 and table[slot[h]] != value:
        h = (h + 1) & (SLOTS - 1)
    return <int64_t>h


def distinct(const double[::1] data, int most):
    """The values that occur, in order of first occurrence, or None where they are more than `most` (at most 65 536)."""
    cdef int64_t k, h, count = 0
    cdef double value
    slots = np.full(SLOTS, -1, dtype=np.int32)
    found = np.empty(most)
    cdef int32_t[::1] slot = slots
    cdef double[::1] out = found
    with nogil:
        for k in range(data.shape[0]):
            value = data[k] + 0.0
            h = _slot(value, &slot[0], &out[0])
            if slot[h] < 0:
                if count == most:
                    count = -1
                    break
                slot[h] = <int32_t>count
                out[count] = value
                count += 1
    return None if count < 0 else found[:count].copy()


def sizes(const int64_t[::1] indptr, const int32_t[::1] indices, int32_t[::1] lower, int32_t[::1] upper):
    """How many entries of each row lead to an earlier and to a later one; returns the totals."""
    cdef int64_t i, k, a = 0, b = 0
    cdef int32_t x, y
    with nogil:
        for i in range(lower.shape[0]):
            x = y = 0
            for k in range(indptr[i], indptr[i + 1]):
                x += indices[k] < i
                y += indices[k] > i
            lower[i] = x
            upper[i] = y
            a += x
            b += y
    return a, b


def fill(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data, const double[::1] table,
         int32_t[::1] low_idx, Value[::1] low_val, int32_t[::1] up_idx, Value[::1] up_val):
    """The entries that `sizes` counted, row by row. table: what codes stand for (not looked at where values are kept)."""
    cdef int64_t i, k, t, a = 0, b = 0
    cdef Value code
    slots = np.full(SLOTS, -1, dtype=np.int32)
    cdef int32_t[::1] slot = slots
    with nogil:
        if Value is not double:
            for t in range(table.shape[0]):
                slot[_slot(table[t], &slot[0], &table[0])] = <int32_t>t
        for i in range(indptr.shape[0] - 1):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] == i:
                    continue
                if Value is double:
                    code = data[k]
                else:
                    code = <Value>slot[_slot(data[k] + 0.0, &slot[0], &table[0])]
                if indices[k] < i:
                    low_idx[a] = indices[k]
                    low_val[a] = code
                    a += 1
                else:
                    up_idx[b] = indices[k]
                    up_val[b] = code
                    b += 1


def loops(const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data):
    """The diagonal, float64[n]."""
    cdef int64_t i, k, n = indptr.shape[0] - 1
    cdef double[::1] out = np.zeros(n)
    with nogil:
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] == i:
                    out[i] += data[k]
    return np.asarray(out)


cdef inline double _row(const int32_t* idx, const Value* val, const double* table, const double* x, int64_t begin, int64_t end) noexcept nogil:
    cdef double total = 0.0
    cdef int64_t k
    for k in range(begin, end):
        if Value is double:
            total = total + val[k] * x[idx[k]]
        else:
            total = total + table[val[k]] * x[idx[k]]
    return total


def back(const int32_t[::1] count, const int32_t[::1] idx, const Value[::1] val, const double[::1] table, const double[::1] scale,
         const double[::1] r, double[::1] p, const double[::1] v, double beta, double gamma, double[::1] t):
    """p <- r + beta p - gamma v, t = K2^-1 p. p may be r."""
    cdef int64_t i, k = idx.shape[0], m
    cdef const int32_t* e = &idx[0] if k else NULL
    cdef const Value* a = &val[0] if k else NULL
    with nogil:
        for i in range(count.shape[0] - 1, -1, -1):
            m = k - count[i]
            p[i] = r[i] + beta * p[i] - gamma * v[i]
            t[i] = p[i] + scale[i] * _row(e, a, &table[0], &t[0], m, k)
            k = m


def forth(const int32_t[::1] count, const int32_t[::1] idx, const Value[::1] val, const double[::1] table, const double[::1] scale,
          const double[::1] v, const double[::1] t, double[::1] w, double[::1] out, const double[::1] other):
    """out = t + w with w = K1^-1 (v - t), which is K1^-1 (I - A) t where v = K2 t; returns (other·out, out·out)."""
    cdef int64_t i, k = 0, m
    cdef double total, dot = 0.0, square = 0.0
    cdef const int32_t* e = &idx[0] if idx.shape[0] else NULL
    cdef const Value* a = &val[0] if idx.shape[0] else NULL
    with nogil:
        for i in range(count.shape[0]):
            m = k + count[i]
            total = v[i] - t[i] + scale[i] * _row(e, a, &table[0], &w[0], k, m)
            k = m
            w[i] = total
            total = total + t[i]
            out[i] = total
            dot = dot + other[i] * total
            square = square + total * total
    return dot, square


def update(double[::1] x, const double[::1] p, double[::1] r, const double[::1] q, const double[::1] shadow, double alpha,
           double omega):
    """x += alpha p + omega r, r -= omega q; returns (shadow·r, r·r, greatest |r|)."""
    cdef int64_t i
    cdef double dot = 0.0, square = 0.0, most = 0.0, left
    with nogil:
        for i in range(x.shape[0]):
            x[i] = x[i] + alpha * p[i] + omega * r[i]
            left = r[i] - omega * q[i]
            r[i] = left
            dot = dot + shadow[i] * left
            square = square + left * left
            left = fabs(left)
            if not left <= most:
                most = left
    return dot, square, most


def shift(double[::1] y, const double[::1] z, double c, const double[::1] other):
    """y += c z; returns (other·y, y·y)."""
    cdef int64_t i
    cdef double dot = 0.0, square = 0.0, whole
    with nogil:
        for i in range(y.shape[0]):
            whole = y[i] + c * z[i]
            y[i] = whole
            dot = dot + other[i] * whole
            square = square + whole * whole
    return dot, square
