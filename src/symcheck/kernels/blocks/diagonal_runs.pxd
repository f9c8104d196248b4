# cython: language_level=3
"""A run: a constant along `length` cells of a diagonal, in a short and a wide form; `value` is a number in a table."""
from libc.stdint cimport uint16_t, uint32_t

cdef extern from *:
    """
    #ifndef SYMCHECK_RUNS
    #define SYMCHECK_RUNS
    typedef struct { uint16_t row, col, length, value; } SmallRun;
    typedef struct { uint32_t row, col, length, value; } WideRun;
    #endif
    """
    ctypedef struct SmallRun:
        uint16_t row, col, length, value
    ctypedef struct WideRun:
        uint32_t row, col, length, value
