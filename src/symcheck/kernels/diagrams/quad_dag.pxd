# cython: language_level=3
"""Declarations that the cutting of the DAG shares with its making."""
from libc.stdint cimport int32_t, int64_t, uint32_t

from symcheck.kernels.tables.memo_table cimport MemoTable

cdef struct Edge:
    int32_t node          # 0: no entries
    uint32_t row
    uint32_t col

cdef struct Node:
    # in an order that gives each row its columns in ascending order; a run has none
    Edge edges[4]
    int64_t entries
    int64_t runs          # runs below, counted with repetition: the size when flattened
    # extent: 1 + the last row, 1 + the last column; the first row and column are 0
    uint32_t rows
    uint32_t cols
    int32_t value         # of a run; -1 otherwise

cdef struct Odd:
    const int32_t* depth
    const int32_t* low
    const int32_t* high
    const int64_t* count

cdef struct Walk:
    const int32_t* level
    const int32_t* low
    const int32_t* high
    const double* values  # of the leaves, which are the nodes below `leaves`
    int32_t leaves
    const int32_t* row_levels
    const int32_t* col_levels
    int32_t k
    Odd row
    Odd col
    MemoTable memo             # triple -> node, place
    Node* nodes
    int64_t used
    int64_t room
    int32_t* unique       # open addressing over nodes, by content; 0 is free
    int64_t unique_size

cdef class Quad:
    cdef Walk w
    cdef Edge* roots
    cdef object table_values
    cdef readonly int64_t rows, columns, triples
    cdef readonly object entries
