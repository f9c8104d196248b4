"""Tuning constants of explicit exploration; `benchmarks/explore.py` measures their effect."""

MIN_FOREST_ITEMS = 4
"""Events, or commands of a participant, from which on the enabled ones are looked up in a decision
forest.
"""

MAX_SWITCH_VALUES = 2048
"""Values of a variable up to which a decision forest branches on it: a branch has an entry per
value.
"""

MAX_MASK_SHARE = 0.5
"""Share of a variable's values that a mask may allow if a branch on the variable is to rule the
item out.
"""

MIN_SWITCH_GAIN = 1.5
"""Expected number of items that a branch must rule out."""

MAX_LEAF_ITEMS = 3
"""Items that a leaf of a decision forest may have without a further branch: evaluating their guards
is as fast.
"""

MAX_FOREST_DEPTH = 3
"""Branches on a path of a decision forest."""

MAX_EAGER_COST = 4
"""Instructions of an operand that are executed even if it does not matter, which costs less than a
jump.
"""

MOST_ANSWERS = 1 << 18
"""Valuations for which a decision in exact arithmetic is kept: some tens of megabytes."""

VALUATIONS_PER_BLOCK = 1 << 20
"""Valuations that the search for initial states extends at a time: 8 MB per variable."""

MEMORY_SHARE = 0.9
"""Share of the available memory that a search may take, unless the user sets a limit."""

SECONDS_PER_SLICE = 0.05
"""Seconds of search between checks of limits and signals, so that Ctrl-C is answered at once. It
affects no result.
"""

MIN_STATES_TO_TRIM = 500_000
"""States from which on freed memory is returned to the system after the search."""

THREADED_STATES, THREADED_ENTRIES = 100_000, 2_000_000
"""States or entries of rows from which on threads help to explore: a search for fewer takes less
than 0.1 seconds."""

FIRST_REGION_STATES, REGION_GROWTH = 1_000, 0.6
"""States of the first region of a model without end; and by how much of its states it grows at a
time."""

GROWING_STATES, GROWING_SHARE = 250_000, 0.1
"""States from which on a model is explored in regions, if a variable without bounds takes new
values in the last share of them."""
ENDLESS_ROUNDS = 8
"""How many times as far a search goes before its end is given up."""
