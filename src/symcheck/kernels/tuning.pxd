# cython: language_level=3
"""Tuning constants of the compiled loops, each with its reason.

They change the speed or the memory of a kernel, and never its result.
"""

cdef enum:
    # tables/state_table: states inserted together. Their slots and rows are prefetched, which needs
    # enough of them to cover the latency of memory; the hashes of a chunk must stay in the first cache.
    INSERT_CHUNK = 256

    # rows/csr_builder: a row of up to so many entries finds equal columns by linear search, which is
    # faster than a hash table that must be cleared first.
    LINEAR_SCAN_ENTRIES = 24
