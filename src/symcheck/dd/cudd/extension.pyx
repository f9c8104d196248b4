# cython: boundscheck=False, wraparound=False, cdivision=True, initializedcheck=False, language_level=3
"""MTBDDs and fast BDD handles in the CUDD manager of a `dd.cudd.BDD`.

The wheel of dd exports the C functions of CUDD that it links. They are resolved here from the library that is loaded
already; what it does not link (bridges between BDDs and MTBDDs, the fused product, the fused image) are short recursions
over CUDD's unique table and cache. Sources: Somenzi, CUDD 3.0 manual; Bahar et al., Algebraic decision diagrams and their
applications (1997); van Dijk & van de Pol, Sylvan (TACAS 2015).

Everything is checked at import: the symbols, the layout of nodes, and how the manager is found. A mismatch is an ImportError.
"""

cimport cython
from cpython.exc cimport PyErr_Occurred
from libc.math cimport fmod, ldexp, pow
from libc.stdint cimport uint64_t, uintptr_t
from libc.stdlib cimport calloc, free, malloc, realloc
from libc.string cimport memcmp, memcpy, memset

import numpy as np

from symcheck.dd.cudd_import import REQUIRED_VERSION, cudd
from symcheck.errors import Interrupted, MemoryLimitError, NumericalError, TimeLimitError

__all__ = [
    "Bdd", "Closure", "Core", "Cube", "Mtbdd", "Renaming", "Transition", "count", "export_nodes", "export_sets", "from_bits", "from_rows",
    "from_table", "import_nodes", "import_sets", "pick", "shared_size", "total", "unite",
]

_TIME = "the time limit was reached while working on decision diagrams: raise it (-timeout, time_limit) or try another engine"

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

_validate_layout()
