# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Gauss-Seidel sweeps over the states of a part of a model, whose other states have given values.

x_s = opt over the rows r of s of (constant_r + sum over t of a_rt x_t). All values are rounded
outwards (`rounding.pxd`).
"""

from libc.math cimport INFINITY
from libc.stdint cimport int32_t, int64_t, uint8_t

import numpy as np

from symcheck.kernels.rounding cimport error_of_sum, round_down, round_up


cdef class PartSweeps:
    """The equations of the unknown states.

    Args:
        indptr, indices, data: int64[rows+1], int32, float64: the rows.
        groups: int64[states+1], the rows of each state; None if each state has one.
        column_ptr, column_rows, row_state: the transposed structure (see
            `symcheck.kernels.graph.mdp_graph`).
        constant: float64[rows], not negative; None for 0.
        unknown: uint8[states].
        mode: 0 without choices, 1 minimum, 2 maximum.
        normalise: whether rows and their constants are divided by all that leaves the state.
    """

    cdef const int64_t[::1] indptr, groups, column_ptr
    cdef const int32_t[::1] indices, column_rows, row_state
    cdef const double[::1] data, constant
    cdef const uint8_t[::1] unknown
    cdef int mode
    cdef bint normalise, grouped

    def __init__(self, indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None,
                 column_ptr: Int64s, column_rows: Int32s, row_state: Int32s,
                 constant: Floats | None, unknown: Masks, int mode, bint normalise):
        self.indptr, self.indices, self.data = indptr, indices, data
        self.column_ptr, self.column_rows = column_ptr, column_rows
        self.row_state = row_state
        self.grouped = groups is not None
        self.groups = indptr if groups is None else groups
        self.constant = constant
        self.unknown, self.mode, self.normalise = unknown, mode, normalise

    def raise_lower(self, double[::1] x, uint8_t[::1] active, double threshold,
                    int64_t sweeps) -> bool:
        """Raise lower bounds by sweeps over the active states, in both orders by turns.

        A relative change above the threshold makes the states active that lead to the changed one.

        Args:
            x: float64[states]. active: uint8[states], states whose bounds may rise.
        Returns:
            Whether some are still active.
        """
        cdef int64_t sweep, i, s, n = self.unknown.shape[0]
        cdef double best
        cdef bint left = True
        with nogil:
            for sweep in range(sweeps):
                left = False
                for i in range(n):
                    s = i if sweep % 2 else n - 1 - i
                    if not active[s]:
                        continue
                    active[s] = 0
                    if not self.unknown[s]:
                        continue
                    best = self.best_value(x, s, False)
                    if best <= x[s]:
                        continue
                    if best - x[s] > threshold * best:
                        left |= self.activate(s, active)
                    x[s] = best
                if not left:
                    break
        return left

    def lower_upper(self, double[::1] x, uint8_t[::1] active, uint8_t[::1] violated, double cap,
                    double threshold, int64_t sweeps) -> tuple[bool, int]:
        """Lower candidates for upper bounds by sweeps over the active states.

        A step raises the candidate of a violated state, as far as is known. A state that is no
        longer violated remains so, since candidates only fall. Candidates without violated states
        are upper bounds of the least solution, whatever older values other parts had.

        Args:
            x: float64[states]. active, violated: uint8[states]. cap: an upper bound of all values.
        Returns:
            Whether some states are still active, and how many are violated.
        """
        cdef int64_t sweep, i, s, n = self.unknown.shape[0], count = 0
        cdef double best
        cdef bint left = True
        with nogil:
            for sweep in range(sweeps):
                left = False
                for i in range(n):
                    s = i if sweep % 2 else n - 1 - i
                    if not active[s]:
                        continue
                    active[s] = 0
                    if not self.unknown[s]:
                        continue
                    best = self.best_value(x, s, True)
                    if best < 0.0:
                        continue
                    if best > cap:
                        best = cap
                    if best <= x[s]:
                        violated[s] = 0
                        if x[s] - best > threshold * best:
                            left |= self.activate(s, active)
                        x[s] = best
                if not left:
                    break
            for i in range(n):
                count += violated[i]
        return left, count

    cdef bint activate(self, int64_t s, uint8_t[::1] active) noexcept nogil:
        """Make the unknown states active that lead to a state; whether there are some."""
        cdef int64_t k
        cdef int32_t p
        cdef bint found = False
        for k in range(self.column_ptr[s], self.column_ptr[s + 1]):
            p = self.row_state[self.column_rows[k]]
            if self.unknown[p] and p != s:
                active[p] = 1
                found = True
        return found

    cdef double best_value(self, double[::1] x, int64_t s, bint upwards) noexcept nogil:
        """The best value of a step from a state, rounded; -1 if all rows only loop."""
        cdef int64_t first = self.groups[s] if self.grouped else s
        cdef int64_t last = self.groups[s + 1] if self.grouped else s + 1
        cdef int64_t r, k
        cdef double value, others, loop, error, best = -1.0
        cdef bint found = False
        for r in range(first, last):
            value = self.constant[r] if self.constant is not None else 0.0
            others = loop = 0.0
            for k in range(self.indptr[r], self.indptr[r + 1]):
                if self.indices[k] == s:
                    loop = loop + self.data[k]
                else:
                    others = others + self.data[k]
                    value = value + self.data[k] * x[self.indices[k]]
            error = error_of_sum(self.indptr[r + 1] - self.indptr[r])
            if loop > 0.0 or self.normalise:
                if others <= 0.0:
                    if self.mode == 1 or value <= 0.0:
                        continue
                    value = INFINITY
                else:
                    value = value / others
                    error = 2.0 * error  # the divisor is a rounded sum
            if value < INFINITY:
                value = round_up(value, error) if upwards else round_down(value, error)
            if not found or (value > best if self.mode == 2 else value < best):
                best = value
                found = True
        return best
