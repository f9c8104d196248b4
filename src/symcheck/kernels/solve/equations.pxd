# cython: language_level=3
"""Systems of equations and the blocks that are copied from them: see equations.pyx."""
from libc.stdint cimport int32_t, int64_t, uint8_t

# Starts of rows and of groups of rows: half the memory if there are less than 2**31 entries.
ctypedef fused index_t:
    int32_t
    int64_t


cdef class Equations:
    cdef public const int64_t[::1] indptr, groups
    cdef public const int32_t[::1] indices
    cdef public const double[::1] data
    cdef public const double[::1] constant_low, constant_high, exit_mass   # None where they are 0
    cdef public const uint8_t[::1] unknown  # None: all states
    cdef public int mode
    cdef public bint normalise
    cdef public int32_t[::1] local_index  # of the states of the block that is loaded; None before
    cdef public int64_t n

    cdef void number_states(self, const int32_t[::1] states)
    cdef void clear_numbers(self, const int32_t[::1] states) noexcept nogil
    cdef bint is_redundant(self, int64_t state, int64_t row) noexcept nogil


cdef class EquationBlock:
    cdef readonly Equations system
    cdef readonly const int32_t[::1] states
    cdef readonly int64_t n, rows, entries
    cdef readonly int mode
    cdef readonly bint has_exit, grouped, wide
    cdef int32_t[::1] row_ptr32, group32
    cdef int64_t[::1] row_ptr64, group64
    cdef public int32_t[::1] indices
    cdef public double[::1] data, constant_low, constant_high
    cdef int32_t[::1] row_offset  # of each row among those of its state; None if none is left out
    cdef int32_t[::1] policy_rows
    cdef double[:, ::1] bounds
    cdef double start_low, start_high
    cdef bint started

    cdef allocate(self, bint offsets)
    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x, bint wide)
    cdef start_bounds(self)
    cdef bint is_chain(self) noexcept nogil
    cdef int64_t global_row(self, int64_t i, int64_t choice) noexcept nogil
    cdef void store(self, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil
