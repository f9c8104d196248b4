# cython: language_level=3
"""Diagonal runs: a constant along `length` cells of a diagonal, in a short and a wide form.

`value` is an index into a table of values.
"""
from libc.stdint cimport int64_t, uint16_t, uint32_t

cdef extern from *:
    """
    #ifndef SYMCHECK_RUNS
    #define SYMCHECK_RUNS
    #include <stdint.h>
    typedef struct { uint16_t row, col, length, value; } SmallRun;
    typedef struct { uint32_t row, col, length, value; } WideRun;
    typedef struct { const SmallRun* small; const WideRun* wide; int64_t count; } Runs;
    #endif
    """
    ctypedef struct SmallRun:
        uint16_t row, col, length, value
    ctypedef struct WideRun:
        uint32_t row, col, length, value
    ctypedef struct Runs:     # the runs of a block, in one of the two forms; the other is NULL
        const SmallRun* small
        const WideRun* wide
        int64_t count
