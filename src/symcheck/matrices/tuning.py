"""Tuning constants of block matrices (`benchmarks/matrix.py` measures their effect)."""

UNDERFLOW_MARGIN = 1e-307
"""More than all products of a sum lose by underflow, 2^-1074 each; a relative rounding error is too
small for subnormal numbers.
"""

MAX_BLOCK_RUNS = 60_000
"""Diagonal runs in all distinct blocks together: about half a megabyte, so that they stay in a
core's cache while their occurrences are multiplied.
"""

SWEEPS_OF_RANGE, SWEEPS_OF_COMPONENT = 1000, 2
"""Most sweeps over a range of rows before the next one: a range that depends on no other may repeat
until it converges, ranges that depend on each other alternate.
"""

MIN_THREADED_ENTRIES = 2_000_000
"""Entries from which on a product uses a second thread, which takes 50 microseconds to start."""

MIN_THREADED_ROWS_ENTRIES = 1_000_000
"""Likewise for compressed rows, which take one to two milliseconds per million entries: to give a
part to a thread takes some 30 microseconds."""
