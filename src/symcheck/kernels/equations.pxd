# cython: language_level=3
from libc.stdint cimport int32_t, int64_t


cdef class Equations:
    cdef public const int64_t[::1] indptr, groups
    cdef public const int32_t[::1] indices
    cdef public const double[::1] data, bl, bh, exit
    cdef public int mode
    cdef public int32_t[::1] place  # of states in the part being loaded; none until there is one
    cdef public int64_t n


cdef class Part:
    cdef public int64_t n, rows, entries
    cdef public int mode
    cdef public int64_t[::1] row_ptr, group, row_id, choice
    cdef public int32_t[::1] idx
    cdef public double[::1] val, bl, bh, exit
    cdef public double[:, ::1] x
    cdef public bint open_, grouped

    cdef reserve(self, int64_t n, int64_t rows, int64_t entries)
    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x)
    cdef bint forced(self) noexcept nogil
    cdef void copy(self, Equations system, const int32_t[::1] states, double[:, ::1] x, bint grouped) noexcept nogil
    cdef void store(self, const int32_t[::1] states, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil
    cpdef bint principle(self)
