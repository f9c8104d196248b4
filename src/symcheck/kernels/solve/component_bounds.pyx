# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False
"""Bounds for x = A x + b with non-negative A and b, component by component, as far as cheap methods
go.

Rows are rounded outwards (`rounding.pxd`). Functions raise MemoryError when memory ends.
"""

import numpy as np

from libc.float cimport DBL_EPSILON, DBL_MAX, DBL_MIN
from libc.math cimport INFINITY, fabs, log
from libc.stdint cimport int32_t, int64_t, uint8_t

from symcheck.kernels.portable cimport (COMPENSATED_ROUNDINGS, Sum, add_product, add_sum, add_term,
                                        divide_by, divided, in_range, is_positive,
                                        product_underflows, quotient, rounded, sum_of)
from symcheck.kernels.tuning cimport MAX_SWEEPS, MIN_SWEEPS, SWEEP_ENTRIES, SWEEP_STATES
from symcheck.kernels.rounding cimport (EXTRA_ROUNDINGS, NEAR_UNDERFLOW, UNDERFLOW_MARGIN,
                                        UNIT_ROUNDOFF, error_of_row, round_down, round_up,
                                        underflow_margin)

include "_equations.pxi"
include "_sweeps.pxi"


cdef bint eliminate_block(EquationBlock block):
    """Solve a block without choices by GTH elimination in a full matrix, for few states.

    The error is bounded as in chains/gth_elimination. Returns False if a state cannot leave, or if
    numbers leave the range of normal doubles (a normal sum has lost at most a rounding).
    Source: Grassmann, Taksar & Heyman (1985).
    """
    cdef int64_t n = block.n, i, j, k, e
    cdef double[:, ::1] matrix = np.zeros((n, n))
    cdef double[::1] exit_mass = block.exit_masses()
    cdef double[::1] pivot = np.empty(n)
    cdef double factor, error
    cdef bint out_of_range = False
    cdef int64_t updates = 0
    cdef Sum total, lo, hi
    block.start_bounds()
    with nogil:
        for i in range(n):
            for e in range(block.row_ptr[i], block.row_ptr[i + 1]):
                matrix[i, block.indices[e]] += block.data[e]
        for k in range(n - 1, -1, -1):
            total = sum_of(exit_mass[k])
            for j in range(k):
                total = add_term(total, matrix[k, j])
            if not is_positive(total):
                with gil:
                    return False
            pivot[k] = rounded(total)
            for i in range(k):
                if matrix[i, k] > 0.0:
                    factor = matrix[i, k] / pivot[k]
                    updates += 1
                    for j in range(k):
                        matrix[i, j] += factor * matrix[k, j]
                        if matrix[i, j] < DBL_MIN and matrix[k, j] > 0.0:
                            out_of_range = True
                    exit_mass[i] += factor * exit_mass[k]
                    block.constant_low[i] += factor * block.constant_low[k]
                    block.constant_high[i] += factor * block.constant_high[k]
                    if (factor < DBL_MIN or (exit_mass[i] < DBL_MIN and exit_mass[k] > 0.0)
                            or (block.constant_low[i] < DBL_MIN and block.constant_low[k] > 0.0)
                            or (block.constant_high[i] < DBL_MIN
                                and block.constant_high[k] > 0.0)):
                        out_of_range = True
        error = ((10.0 * updates + (10.0 + COMPENSATED_ROUNDINGS) * n + 20.0) * UNIT_ROUNDOFF
                 + 2.0 * n * block.system.error)
        for k in range(n):
            lo = sum_of(block.constant_low[k])
            hi = sum_of(block.constant_high[k])
            for j in range(k):
                lo = add_product(lo, matrix[k, j], block.bounds[j, 0])
                hi = add_product(hi, matrix[k, j], block.bounds[j, 1])
                if (product_underflows(matrix[k, j], block.bounds[j, 0])
                        or product_underflows(matrix[k, j], block.bounds[j, 1])):
                    out_of_range = True
            block.bounds[k, 0] = divided(lo, pivot[k])
            block.bounds[k, 1] = divided(hi, pivot[k])
            if ((is_positive(lo) and block.bounds[k, 0] < DBL_MIN)
                    or (is_positive(hi) and block.bounds[k, 1] < DBL_MIN)
                    or (block.bounds[k, 1] > DBL_MAX and in_range(hi))):
                out_of_range = True
        for k in range(n):
            block.bounds[k, 0] = block.bounds[k, 0] * (1.0 - error)
            block.bounds[k, 1] *= 1.0 + error
            if block.bounds[k, 1] > 0.0:
                block.bounds[k, 1] += UNDERFLOW_MARGIN
    return not out_of_range


cdef class ComponentSolver(Equations):
    """A system of equations, and the solution of its components by cheap methods; see Equations for
    the arguments.
    """

    def block(self, const int32_t[::1] states, double[:, ::1] x) -> Block:
        """The block of some states, with the bounds of all others known.

        Args:
            states: int32[n].
            x: float64[states of the system, 2], the bounds.
        """
        cdef Block block = Block()
        block.load(self, states, x)
        return block

    def store(self, Block block, double[:, ::1] x, int64_t[::1] strategy):
        """Write the bounds of a block to x (float64[states, 2]) and its choices to strategy
        (int64[states] or empty).
        """
        block.start_bounds()
        block.store(x, strategy)

    cdef bint solve_single_state(self, int64_t s, double[:, ::1] x,
                                 int64_t[::1] strategy) noexcept nogil:
        """Bounds of a state that is a component of its own; False if its value is infinite."""
        cdef int64_t first = s if self.mode == 0 else self.groups[s]
        cdef int64_t last = s + 1 if self.mode == 0 else self.groups[s + 1]
        cdef int64_t r, k, best = -1
        cdef const double* data = &self.data[0]
        cdef const int32_t* indices = &self.indices[0]
        cdef const int64_t* indptr = &self.indptr[0]
        cdef double* y
        cdef double* base = &x[0, 0]
        cdef double lo, hi, loop, margin, best_lo = 0.0, best_hi = 0.0, a
        cdef int32_t c
        cdef Sum total
        cdef bint infinite = False, constants = self.constant_low is not None, tiny, copied
        for r in range(first, last):
            lo = self.constant_low[r] if constants else 0.0
            hi = self.constant_high[r] if constants else 0.0
            # A step with probability 1, as time passes, rounds nothing.
            k = indptr[r]
            copied = (lo == hi == 0.0 and self.error == 0.0 and not self.normalise
                      and indptr[r + 1] == k + 1 and indices[k] != s and data[k] == 1.0)
            loop = 0.0
            for k in range(indptr[r], indptr[r + 1]):
                c = indices[k]
                a = data[k]
                if c == s:
                    loop = loop + a
                else:
                    y = base + 2 * <int64_t>c
                    lo = lo + a * y[0]
                    hi = hi + a * y[1]
            tiny = lo >= 0.0 and hi < NEAR_UNDERFLOW
            total = sum_of(1.0)
            if loop > 0.0 or self.normalise:
                total = sum_of(self.exit_mass[r] if self.exit_mass is not None else 0.0)
                for k in range(indptr[r], indptr[r + 1]):
                    if indices[k] != s:
                        total = add_term(total, data[k])
                if not is_positive(total):
                    if hi > 0.0:
                        infinite = infinite or self.mode != 1
                    continue
                lo = divide_by(lo, total)
                hi = divide_by(hi, total)
            if tiny and not copied:
                self.bounds_near_underflow(s, r, base, total, &lo, &hi)
            # Products, sums, and the rounding itself; where it is divided, the sum of the row too.
            margin = (indptr[r + 1] - indptr[r] + 3.0) * UNIT_ROUNDOFF + self.error
            if loop > 0.0 or self.normalise:
                margin = margin + 4.0 * UNIT_ROUNDOFF + self.error
            if not copied:
                lo = round_down(lo, margin)
                hi = round_up(hi, margin)
            if best < 0:
                best = r
                best_lo = lo
                best_hi = hi
            elif self.mode == 2:
                if lo > best_lo:
                    best_lo = lo
                    best = r
                if hi > best_hi:
                    best_hi = hi
            else:
                if hi < best_hi:
                    best_hi = hi
                    best = r
                if lo < best_lo:
                    best_lo = lo
        if infinite and (best < 0 or self.mode == 2):
            best_lo = best_hi = INFINITY
        x[s, 0] = best_lo
        x[s, 1] = best_hi
        if strategy.shape[0]:
            strategy[s] = best
        return not infinite

    def sweep_acyclic(self, double[:, ::1] x, int64_t[::1] strategy, bint descending):
        """Solve all states in index order.

        Every edge but self-loops must lead to states that come earlier in that order.

        Args:
            x: float64[states, 2], receives the bounds. strategy: int64[states] or empty, receives
                the rows.
            descending: start at the last state.
        """
        cdef int64_t i, s
        with nogil:
            for i in range(self.n):
                s = self.n - 1 - i if descending else i
                if self.unknown is None or self.unknown[s]:
                    self.solve_single_state(s, x, strategy)

    def advance(self, const int32_t[::1] order, const int64_t[::1] start, int64_t component,
                double[:, ::1] x, int64_t[::1] strategy, const int32_t[::1] depth,
                double width_per_depth, bint relative, bint probability, int64_t elimination_limit,
                int64_t[::1] counters) -> int:
        """Solve components one after the other, as far as cheap methods go.

        These are: single states; elimination of blocks without choices; a limited number of sweeps
        over blocks with choices.

        Args:
            order: int32, the states by component, successors first. start: int64[components+1] into
                `order`.
            component: the first component to solve.
            x: float64[states, 2], receives the bounds. strategy: int64[states] or empty, receives
                the rows.
            depth: int32[components]; the bounds of component c must be depth[c] * width_per_depth
                apart.
            relative: whether widths are relative. probability: whether values are at most 1.
            elimination_limit: most states of a block to eliminate.
            counters: int64[6], to which are added: single states, eliminated blocks, swept blocks,
                sweeps; and which keep the states of the largest eliminated and of the largest swept
                block.
        Returns:
            The first component that needs another method, or the number of components.
        """
        cdef int64_t count = start.shape[0] - 1, size, sweeps
        cdef double width
        cdef Block block = Block()
        cdef bint done
        while component < count:
            with nogil:
                while component < count and start[component + 1] - start[component] == 1:
                    self.solve_single_state(order[start[component]], x, strategy)
                    counters[0] += 1
                    component += 1
            if component == count:
                break
            states = order[start[component]: start[component + 1]]
            size = states.shape[0]
            if size > (elimination_limit if self.mode == 0 else SWEEP_STATES):
                break
            block.load(self, states, x)
            if not block.has_exit or (block.mode == 0 and size > elimination_limit):
                break
            if block.mode == 0:
                done = eliminate_block(block)
                counters[1] += 1
                counters[4] = max(counters[4], size)
            else:
                width = depth[component] * width_per_depth
                sweeps = min(MAX_SWEEPS, max(MIN_SWEEPS, SWEEP_ENTRIES // (block.entries + block.n
                                                                           + 1)))
                if probability:
                    done, sweeps, _ = block.interval_iteration(width, relative, sweeps)
                else:
                    done, sweeps, _ = block.optimistic_value_iteration(width, relative, sweeps)
                counters[3] += sweeps
                counters[2] += done
                counters[5] = max(counters[5], size if done else 0)
            if not done:
                break
            with nogil:
                block.store(x, strategy)
            component += 1
        return component
