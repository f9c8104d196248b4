# cython: language_level=3
"""The block partition, shared with the products."""
from libc.stdint cimport int32_t, int64_t, uint32_t

from symcheck.kernels.blocks.diagonal_runs cimport SmallRun, WideRun
from symcheck.kernels.diagrams.quad_dag cimport Node, QuadDag

cdef struct Block:
    int64_t start         # first run, in the array of its kind
    int64_t runs
    uint32_t rows
    uint32_t cols
    bint wide

cdef struct Occurrence:
    int32_t block
    uint32_t row
    uint32_t col

cdef class BlockPartition:
    cdef Block* blocks
    cdef SmallRun* small
    cdef WideRun* wide
    cdef Occurrence* occurrences
    cdef int64_t small_count, wide_count, block_count, occurrence_count
    cdef int64_t[:, ::1] occurrence_start        # of a root in a range of rows
    cdef int64_t[::1] bounds
    cdef const double[::1] values
    cdef readonly int64_t rows, columns, roots, ranges, threshold, range_rows
    cdef readonly object entries, range_bounds, range_work  # type: Int64s
    cdef int64_t _choose_threshold(self, QuadDag dag, int64_t budget, int32_t* block_of) except -1
    cdef tuple _measure(self, QuadDag dag, int64_t threshold, int32_t* block_of)
    cdef int _flatten_blocks(self, QuadDag dag, int32_t* block_of, bint ordered) except -1
    cdef int _list_occurrences(self, QuadDag dag, const int32_t* block_of) except -1
    cdef void _append_occurrences(self, const Node* nodes, const int32_t* block_of,
                                  int32_t node_number, uint32_t row, uint32_t col) noexcept nogil
    cdef int _split_into_ranges(self, bint whole) except -1
    cdef int64_t _longest_range(self)
    cdef int64_t _check_arguments(self, int root, int64_t rows, int64_t columns, int64_t first,
                                  int64_t last) except -1
