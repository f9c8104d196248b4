"""Tuning constants of the simulator."""

MAX_BRANCHES = 1 << 25
"""Drop a lazily expanded chain and begin it again beyond this many branches (about 1 GB)."""

PATHS_PER_BATCH = 1 << 14
"""Number of paths that are sampled at a time. Each step costs about 0.1 ms and draws a number for
all of them, also for those that are decided, which costs less up to this size.
"""

FIRST_BATCH = 256
"""Number of paths that are sampled at first: soon there is an estimate that can be shown."""

STEPS_PER_BATCH = 1 << 22
"""Steps of a batch up to which the next one has four times as many paths: about a second."""

MIN_PATHS_ON_WORKERS = 4096
"""Sample fewer paths in this process: they take less time than to start another."""

BATCHES_ON_WORKERS = 16
"""Number of batches for workers, at least: several for each, so that they end together."""

MAX_SEQUENTIAL_BLOCK = 1 << 18
"""Number of paths that a sequential test samples at a time, at most."""

FIRST_GRAPH_CHECK = 16
"""Search for paths that cannot reach the target after this many steps, and after each doubling."""

MAX_EXPLORED_STATES = 20_000
"""Explore a chain of at most this many states completely for that search; otherwise an unvisited
successor of a rarely visited state leaves it incomplete.
"""

MAX_RANGE_WORK = 1 << 24
"""Branches that the search for the range of a reward visits, at most: a tenth of a second."""

MAX_RANGE_ROUNDS = 4096
"""Rounds of that search, at most: longer paths earn a reward of unknown range."""

MAX_REWARD_VALUATIONS = 1 << 16
"""Valuations over which the reward of a state is bounded, if there are too many states."""

ROUNDING = 1e-11
"""Intervals of rewards are wider by this share of the largest sample: the rounding of sums over
10 000 steps.
"""
