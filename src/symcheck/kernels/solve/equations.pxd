# cython: language_level=3
from libc.stdint cimport int32_t, int64_t, uint8_t

# Where rows and groups of rows begin: half the memory where there are less than 2**31 entries.
ctypedef fused index_t:
    int32_t
    int64_t


cdef class Equations:
    cdef public const int64_t[::1] indptr, groups
    cdef public const int32_t[::1] indices
    cdef public const double[::1] data, bl, bh, exit  # the last three: None where they are 0
    cdef public const uint8_t[::1] unknown  # None: all states
    cdef public int mode
    cdef public bint rates
    cdef public int32_t[::1] place  # of states in the part being loaded; none until there is one
    cdef public int64_t n

    cdef void put(self, const int32_t[::1] states)
    cdef void clear(self, const int32_t[::1] states) noexcept nogil
    cdef bint useless(self, int64_t state, int64_t row) noexcept nogil


cdef class Part:
    cdef readonly Equations system
    cdef readonly const int32_t[::1] states
    cdef readonly int64_t n, rows, entries
    cdef readonly int mode
    cdef readonly bint open_, grouped, wide
    cdef int32_t[::1] ptr32, group32
    cdef int64_t[::1] ptr64, group64
    cdef public int32_t[::1] idx
    cdef public double[::1] val, bl, bh
    cdef int32_t[::1] offset  # of each row among the rows of its state; None where no row is left out
    cdef int32_t[::1] picked
    cdef double[:, ::1] bounds
    cdef double least, most
    cdef bint begun

    cdef reserve(self, bint offsets)
    cdef load(self, Equations system, const int32_t[::1] states, double[:, ::1] x, bint wide)
    cdef begin(self)
    cdef bint forced(self) noexcept nogil
    cdef int64_t original(self, int64_t i, int64_t choice) noexcept nogil
    cdef void store(self, double[:, ::1] x, int64_t[::1] strategy) noexcept nogil
