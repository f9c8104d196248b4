# cython: language_level=3
"""Blocks of equations with sweeps: see sweeps.pyx."""
from libc.stdint cimport int64_t

from symcheck.kernels.solve.equations cimport EquationBlock


cdef class Block(EquationBlock):
    cdef void choose_missing_rows(self) noexcept nogil
    cdef double sweep_bounds(self, bint relative, bint backwards) noexcept nogil
    cdef double sweep_lower(self, bint relative) noexcept nogil
    cdef int sweep_upper(self, double[::1] high) noexcept nogil
    cpdef tuple interval_iteration(self, double width, bint relative, int64_t budget)
    cpdef tuple optimistic_value_iteration(self, double width, bint relative, int64_t budget,
                                           bint restart=*)
