# cython: language_level=3
"""Declarations that the products share with the cutting."""
from libc.stdint cimport int32_t, int64_t, uint32_t

from symcheck.kernels.blocks.diagonal_runs cimport SmallRun, WideRun
from symcheck.kernels.diagrams.quad_dag cimport Node, Quad

cdef struct Block:
    int64_t start         # first run, in the array of its kind
    int64_t runs
    uint32_t rows
    uint32_t cols
    bint wide

cdef struct Place:
    int32_t block
    uint32_t row
    uint32_t col

cdef class Cut:
    cdef Block* blocks
    cdef SmallRun* small
    cdef WideRun* wide
    cdef Place* places
    cdef int64_t small_used, wide_used, blocks_used, places_used
    cdef int64_t[:, ::1] starts        # of the places of a root in a part
    cdef int64_t[::1] bounds
    cdef const double[::1] values
    cdef readonly int64_t rows, columns, roots, parts, threshold, range_rows
    cdef readonly object entries, part_rows, part_work
    cdef int64_t _choose(self, Quad quad, int64_t budget, int32_t* block_of) except -1
    cdef tuple _measure(self, Quad quad, int64_t threshold, int32_t* block_of)
    cdef int _compile(self, Quad quad, int32_t* block_of, bint ordered) except -1
    cdef int _stand(self, Quad quad, const int32_t* block_of) except -1
    cdef void _stand_at(self, const Node* nodes, const int32_t* block_of, int32_t number, uint32_t row, uint32_t col) noexcept nogil
    cdef int _part(self, bint whole) except -1
    cdef int64_t _longest(self)
    cdef int64_t _check(self, int root, int64_t rows, int64_t columns, int64_t first, int64_t last) except -1
