"""Tuning constants of the simulator."""

MAX_BRANCHES = 1 << 25
"""Drop a lazily expanded chain and begin it again beyond this many branches (about 1 GB)."""

PATHS_PER_BATCH = 1 << 16
"""Number of paths that are sampled at a time: their arrays take a few megabytes."""

FIRST_GRAPH_CHECK = 16
"""Search for paths that cannot reach the target after this many steps, and after each doubling."""

MAX_EXPLORED_STATES = 20_000
"""Explore a chain of at most this many states completely for that search; otherwise an unvisited
successor of a rarely visited state leaves it incomplete.
"""
