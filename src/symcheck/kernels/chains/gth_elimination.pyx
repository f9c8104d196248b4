# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""Sparse elimination of the states of a Markov chain, without a single subtraction.

Grassmann, Taksar & Heyman (1985): a state's diagonal is the sum of what leaves it. So every operation acts on positive
numbers, and the result has small relative error in each entry, however slowly the chain mixes. Each elimination changes
the entries of the rows that it updates by at most 5 roundings relative; as every forest in the chain's weights takes one
edge per state, this moves each solution entry by at most 10 roundings relative per updated row (O'Cinneide 1993).
"""

import numpy as np

from libc.float cimport DBL_MAX, DBL_MIN
from libc.stdint cimport int32_t, int64_t
from libc.stdlib cimport free, malloc, realloc

cdef double U = 1.1102230246251568e-16


cdef struct List:
    int32_t* idx
    double* val
    int32_t size, room


cdef inline int push(List* row, int32_t i, double v, bint values) noexcept nogil:
    cdef int32_t room
    if row.size == row.room:
        room = row.room * 2 if row.room else 4
        row.idx = <int32_t*>realloc(row.idx, room * sizeof(int32_t))
        if values:
            row.val = <double*>realloc(row.val, room * sizeof(double))
        if row.idx == NULL or (values and row.val == NULL):
            return 1
        row.room = room
    row.idx[row.size] = i
    if values:
        row.val[row.size] = v
    row.size += 1
    return 0


cdef class Elimination:
    """Factors of I - A, for substochastic A with the leaving mass `exit` per row.

    complete: False where it was given up: `limit` operations were not enough, a state cannot leave, or numbers became so small
    that doubles lose their digits.
    error: bound on the relative error of each entry of a solution with non-negative right-hand side.
    lost: whether doubles were too small or too large for some entry, which the bound does not hold for.
    """

    cdef List* rows
    cdef List* columns
    cdef List* ups
    cdef int64_t n
    cdef int64_t[::1] order
    cdef double[::1] total, leave
    cdef public double error
    cdef public bint complete, lost
    cdef public int64_t operations, updates

    def __cinit__(self, const int64_t[::1] indptr, const int32_t[::1] indices, const double[::1] data,
                  const double[::1] exit, int64_t limit):
        cdef int64_t n = indptr.shape[0] - 1, i, k
        self.n = n
        self.order = np.empty(n, dtype=np.int64)
        self.total = np.zeros(n)
        self.leave = np.array(exit)
        self.rows = <List*>malloc(max(n, 1) * sizeof(List))
        self.columns = <List*>malloc(max(n, 1) * sizeof(List))
        self.ups = <List*>malloc(max(n, 1) * sizeof(List))
        if self.rows == NULL or self.columns == NULL or self.ups == NULL:
            raise MemoryError
        for i in range(n):
            self.rows[i] = List(NULL, NULL, 0, 0)
            self.columns[i] = List(NULL, NULL, 0, 0)
            self.ups[i] = List(NULL, NULL, 0, 0)
        for i in range(n):
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] != i:
                    push(&self.rows[i], indices[k], data[k], True)
                    push(&self.columns[indices[k]], <int32_t>i, 0.0, False)
        self.lost = False
        self.complete = self.run(limit) == 0 and not self.lost
        self.error = (10.0 * self.updates + 10.0 * n + 20.0) * U

    def __dealloc__(self):
        cdef int64_t i
        for i in range(self.n):
            if self.rows != NULL:
                free(self.rows[i].idx)
                free(self.rows[i].val)
            if self.columns != NULL:
                free(self.columns[i].idx)
                free(self.columns[i].val)
            if self.ups != NULL:
                free(self.ups[i].idx)
                free(self.ups[i].val)
        free(self.rows)
        free(self.columns)
        free(self.ups)

    cdef int run(self, int64_t limit) except -1:
        """Eliminate all states, those with the fewest fill-ins (in-degree × out-degree) first. 1: gave up."""
        cdef int64_t n = self.n, done = 0, cost, bucket, b, i
        cdef int64_t buckets = 4096
        cdef int32_t k, p
        # Doubly linked lists of states by cost.
        cdef int32_t[::1] head = np.full(buckets, -1, dtype=np.int32)
        cdef int32_t[::1] after = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] before = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] at = np.full(n, -1, dtype=np.int32)
        cdef int32_t[::1] place = np.full(n, -1, dtype=np.int32)
        cdef int status = 0
        with nogil:
            for i in range(n):
                link(<int32_t>i, self.cost(i, buckets), head, after, before, at)
            bucket = 0
            while done < n:
                while bucket < buckets and head[bucket] < 0:
                    bucket += 1
                k = head[bucket]
                unlink(k, head, after, before, at)
                self.order[done] = k
                done += 1
                status = self.step(k, place, done == n)
                if status != 0 or self.lost or self.operations > limit:
                    status = 1
                    break
                # Degrees changed for the neighbours of k.
                for i in range(self.ups[k].size):
                    p = self.ups[k].idx[i]
                    unlink(p, head, after, before, at)
                    b = self.cost(p, buckets)
                    link(p, b, head, after, before, at)
                    if b < bucket:
                        bucket = b
                for i in range(self.rows[k].size):
                    p = self.rows[k].idx[i]
                    unlink(p, head, after, before, at)
                    b = self.cost(p, buckets)
                    link(p, b, head, after, before, at)
                    if b < bucket:
                        bucket = b
        return status

    cdef int64_t cost(self, int64_t i, int64_t buckets) noexcept nogil:
        """Fill-ins to expect, on a scale that gets coarser above 2 048."""
        cdef int64_t c = <int64_t>self.rows[i].size * self.columns[i].size
        cdef int64_t step = 2048
        if c < step:
            return c
        while c >= 2 * 2048 and step < buckets - 64:
            c >>= 1
            step += 64
        step += (c - 2048) >> 5
        return step if step < buckets else buckets - 1

    cdef int step(self, int32_t k, int32_t[::1] place, bint last) noexcept nogil:
        cdef List* row = &self.rows[k]
        cdef List* other
        cdef int32_t e, f, i, j, found
        cdef double g
        cdef long double total = self.leave[k]
        for e in range(row.size):
            total = total + row.val[e]
        self.total[k] = <double>total
        if total <= 0.0:
            return 0 if last else 1
        # The columns of k's successors lose k.
        for e in range(row.size):
            other = &self.columns[row.idx[e]]
            for f in range(other.size):
                if other.idx[f] == k:
                    other.size -= 1
                    other.idx[f] = other.idx[other.size]
                    break
            self.operations += other.size
        for f in range(self.columns[k].size):
            i = self.columns[k].idx[f]
            other = &self.rows[i]
            found = -1
            for e in range(other.size):
                place[other.idx[e]] = e
                if other.idx[e] == k:
                    found = e
            g = other.val[found] / self.total[k]
            if push(&self.ups[k], i, g, True):
                return 1
            # A sum that is a normal number has lost no more than a rounding, whatever its terms are.
            self.leave[i] += g * self.leave[k]
            if g < DBL_MIN or (self.leave[i] < DBL_MIN and self.leave[k] > 0.0):
                self.lost = True
            for e in range(row.size):
                j = row.idx[e]
                if j == i:
                    continue
                if place[j] >= 0:
                    other.val[place[j]] += g * row.val[e]
                else:
                    place[j] = other.size
                    if push(other, j, g * row.val[e], True) or push(&self.columns[j], i, 0.0, False):
                        return 1
                if other.val[place[j]] < DBL_MIN:
                    self.lost = True
            for e in range(other.size):
                place[other.idx[e]] = -1
            other.size -= 1
            other.idx[found] = other.idx[other.size]
            other.val[found] = other.val[other.size]
            self.updates += 1
            self.operations += row.size + 2 * other.size
        free(self.columns[k].idx)
        self.columns[k].idx = NULL
        self.columns[k].size = 0
        self.columns[k].room = 0
        return 0

    def solve(self, const double[::1] right):
        """x with x = A x + right, for right >= 0: relative error at most `error` in each entry (infinite: that state never leaves).

        `lost` says afterwards whether that does not hold, for some entry left the range of normal doubles.
        """
        cdef int64_t n = self.n, i, e
        cdef int32_t k, p
        cdef double[::1] x = np.array(right)
        cdef double before
        cdef long double total
        with nogil:
            for i in range(n):
                k = <int32_t>self.order[i]
                if x[k] == 0.0:
                    continue
                for e in range(self.ups[k].size):
                    p = self.ups[k].idx[e]
                    before = x[p]
                    x[p] += self.ups[k].val[e] * x[k]
                    if x[p] < DBL_MIN or (x[p] > DBL_MAX >= x[k] and before <= DBL_MAX):
                        self.lost = True
            for i in range(n - 1, -1, -1):
                k = <int32_t>self.order[i]
                total = x[k]
                for e in range(self.rows[k].size):
                    total = total + <long double>self.rows[k].val[e] * x[self.rows[k].idx[e]]
                x[k] = <double>(total / self.total[k])
                if total > 0.0 and (x[k] < DBL_MIN or (x[k] > DBL_MAX and total <= DBL_MAX)):
                    self.lost = True
        return np.asarray(x)

    def stationary(self):
        """Left null vector of a chain that nothing leaves, summing to 1: relative error at most `error` in each entry."""
        cdef int64_t n = self.n, i, e
        cdef int32_t k
        cdef double[::1] x = np.zeros(n)
        cdef long double total
        with nogil:
            # The last state has weight 1; the weight of k flows in from the states eliminated after it.
            k = <int32_t>self.order[n - 1]
            x[k] = 1.0
            for i in range(n - 2, -1, -1):
                k = <int32_t>self.order[i]
                total = 0.0
                for e in range(self.ups[k].size):
                    total = total + self.ups[k].val[e] * x[self.ups[k].idx[e]]
                x[k] = <double>total
        out = np.asarray(x)
        return out / out.sum()


cdef inline void link(int32_t i, int64_t b, int32_t[::1] head, int32_t[::1] after, int32_t[::1] before,
                      int32_t[::1] at) noexcept nogil:
    after[i] = head[b]
    before[i] = -1
    if head[b] >= 0:
        before[head[b]] = i
    head[b] = i
    at[i] = <int32_t>b


cdef inline void unlink(int32_t i, int32_t[::1] head, int32_t[::1] after, int32_t[::1] before, int32_t[::1] at) noexcept nogil:
    if before[i] >= 0:
        after[before[i]] = after[i]
    else:
        head[at[i]] = after[i]
    if after[i] >= 0:
        before[after[i]] = before[i]
