# cython: language_level=3
"""The quad-DAG as plain C structures, shared with the block partition."""
from libc.stdint cimport int32_t, int64_t, uint32_t

from symcheck.kernels.diagrams.odd cimport Diagram, Odd
from symcheck.kernels.tables.memo_table cimport MemoTable

cdef struct Edge:
    int32_t node          # 0: no entries
    uint32_t row
    uint32_t col

cdef struct Node:
    # ordered so that each row gets ascending columns; a run has none
    Edge edges[4]
    int64_t entries
    int64_t runs          # runs below, with repetition: the size when flattened
    # 1 + the last row; the first row and column are 0
    uint32_t rows
    uint32_t cols
    int32_t value         # of a run; -1 otherwise

cdef struct Builder:
    Diagram diagram
    const int32_t* row_levels
    const int32_t* col_levels
    int32_t k
    Odd row
    Odd col
    MemoTable memo             # triple -> node, place
    Node* nodes
    int64_t node_count
    int64_t capacity
    int32_t* unique       # open addressing over nodes, by content; 0 is free
    int64_t unique_size

cdef class QuadDag:
    cdef Builder builder
    cdef Edge* roots
    cdef object values
    cdef readonly int64_t rows, columns, triples
    cdef readonly object entries  # type: Int64s
