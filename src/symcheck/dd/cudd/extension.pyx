# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False,
# language_level=3
"""MTBDDs and fast BDD handles in a CUDD manager, that of a `dd.cudd.BDD` if dd has CUDD.

The wheel of dd exports the C functions of CUDD that it links. They are resolved here from it, or
from a shared library of the system (see `symcheck.dd.cudd_import`). Operations that it does not link (conversions between BDDs and MTBDDs,
matrix multiplication, images, saturation) are recursions over CUDD's unique table and computed
table.

The symbols, the layout of nodes and the way to the manager are checked when the first manager is
made. A mismatch is an UnsupportedError.

Sources: Bryant (1986), Graph-based algorithms for Boolean function manipulation; Clarke, Fujita,
McMillan, Yang and Zhao (1993), Spectral transforms for large Boolean functions (MTBDDs); Bahar et
al. (1997), Algebraic decision diagrams and their applications; Somenzi (2015), CUDD 3.0 manual; van
Dijk and van de Pol (2015), Sylvan.
"""

cimport cython
from cpython.exc cimport PyErr_Occurred
from libc.math cimport ldexp
from libc.stdint cimport uint64_t, uintptr_t
from libc.stdlib cimport calloc, free, malloc, realloc
from libc.string cimport memcmp, memcpy, memset

from symcheck.kernels.portable cimport monotonic_seconds

import ctypes

import numpy as np

from symcheck.dd.cudd_import import REQUIRED_VERSION, Function, library
from symcheck.dd.tuning import MAX_PARTITIONS
from symcheck.errors import (
    Interrupted, MemoryLimitError, NumericalError, TimeLimitError, UnsupportedError,
)

__all__ = [
    "Bdd", "Core", "Cube", "Mtbdd", "Renaming", "Saturation", "Transition", "count", "export_nodes", "export_sets",
    "from_bits", "from_rows", "from_table", "import_nodes", "import_sets", "pick", "shared_size",
]

_TIME = "the time limit was reached in an operation on decision diagrams\n  hint: raise it, or try another engine"

cdef bint loaded = False

include "_symbols.pxi"
include "_core.pxi"
include "_recursions.pxi"
include "_steps.pxi"
include "_prepared.pxi"
include "_sets.pxi"
include "_saturation.pxi"
include "_numbers.pxi"
include "_export.pxi"
include "_tables.pxi"
