# cython: language_level=3
from libc.stdint cimport int64_t

from symcheck.kernels.solve.equations cimport Part


cdef class Block(Part):
    cdef void set_choices(self) noexcept nogil
    cdef double pair_sweep(self, bint relative, bint backwards) noexcept nogil
    cdef double low_sweep(self, bint relative) noexcept nogil
    cdef int high_sweep(self, double[::1] high) noexcept nogil
    cpdef tuple interval(self, double goal, bint relative, int64_t budget)
    cpdef tuple optimistic(self, double goal, bint relative, int64_t budget, bint fresh=*)
