"""Tuning constants of the diagrams; those of the compiled recursions are in `cudd/_core.pxi`."""

INITIAL_CACHE_ENTRIES = 2**15
"""Entries (32 bytes each) of CUDD's computed table at the start; CUDD doubles it while that pays.
The default of dd, 2**18, costs 3 ms per manager.
"""

MEMORY_ESTIMATE = 2**26
"""Bytes; CUDD touches a 64th of it in advance, which takes 4 ms per GiB. It limits nothing."""

LEAST_MEMORY = 2**22
"""Bytes; the tables of a manager without nodes take most of it."""

MIN_CACHE_HIT_PERCENT = 5
"""Hit rate above which CUDD enlarges the computed table. Searches of timed models seldom reach
CUDD's 30 percent and then forget their results: firewire_impl_dl does twice the work.
"""

BYTES_PER_FAST_GROWTH_SLOT = 160
"""Bytes of the memory limit per slot up to which the unique table grows without garbage collection:
a fifth of the nodes that fit. Collecting does not pay below that.
"""

MOST_PYTHON_NODES = 200_000
"""Nodes of a manager in pure Python, at most. It is for teaching, and far slower than CUDD."""

MAX_PARTITIONS = 200_000
"""Event partitions of a saturation, at most. Their number may grow with the states, and saturation
then does not pay."""

FIRST_LOOKUPS = {True: 30_000_000, False: 300_000}
"""Cache look-ups of the first turn of `saturate`, forward and backward. Forward, the second mode
gains little where it wins and costs much where it loses.
"""
