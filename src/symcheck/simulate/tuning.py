"""Tuning constants of the simulator."""

MAX_BRANCHES = 1 << 25
"""Branches beyond which a lazily expanded chain is dropped and begun again: about 1 GB."""

PATHS_PER_BATCH = 1 << 16
"""Paths that are sampled at a time: their arrays stay within a few megabytes."""

FIRST_GRAPH_CHECK = 16
"""Steps after which, and then after each doubling, paths that cannot reach the target are searched
for.
"""

MAX_EXPLORED_STATES = 20_000
"""States up to which a chain is explored for that search; otherwise a step to a rare state would
leave it incomplete.
"""
