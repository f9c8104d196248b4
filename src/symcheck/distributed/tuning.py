"""Constants of distributed models."""

ROUND_ENTRIES = 1 << 20
"""Entries of rows that a part explores before it sends states to others: all parts have equal work
in a round, of some tens of milliseconds.
"""

FIRST_ROUND_ENTRIES = 1 << 14
"""The first rounds are short, double each time, and begin with this number: the other parts have
nothing to do before the first states reach them.
"""

SAMPLE_STATES = 300_000
"""First states of the model, among which variables are chosen that name the owner of a state."""

COMPARED_STATES = 20_000
"""States of the sample whose owners are compared."""

SAMPLE_ROWS = 5_000
"""States of the sample whose successors are compared with them."""

SEEDS = 8
"""Hashes that are compared for each choice of variables."""

KEYS_PER_PART = 16
"""Values of the chosen variables in the sample for each part: few values make parts uneven, and
parts that wait for each other.
"""

BLOCKS_PER_PART = 2
"""Least number of blocks of values of a variable for each part: with fewer, states that are found
later have one owner.
"""

LEAST_TURNS = 0.25
"""A variable with blocks of values falls at least so often for each time it rises, or reversely."""

COST_OF_CROSSING = 3.0
"""A transition to another part costs as much as so many within a part."""

SWEEPS_PER_ROUND = 32
"""Most sweeps of a part between two exchanges; they visit active states only."""

SUBSTITUTION_SHARE = 0.5 / 128
"""Share of the requested width by which bounds may move apart at each component on a path: a path
through more components that are solved by iteration is seldom.
"""

SUBSTITUTION_WIDTH = 0.5
"""Share of the requested width that may be used up before the other states are iterated."""

MAX_SUBSTITUTION_STEPS = 1 << 20
"""Most shares of the width that are counted: bounds that are so far apart are not used."""

FIRST_TOLERANCE = 0.1
"""At first, changes of lower bounds below this share of the requested width are not passed on."""

DENSE_SHARE = 0.6
"""Values are sent without their places if more than this share of them has changed."""

MAX_ROUNDS = 1_000_000
"""Rounds after which an iteration is given up."""

MIN_CHANGE = 1e-16
"""Relative change below which bounds cannot improve: rounding is as large."""

SERIES_ERROR = 1e-10
"""Relative error of Poisson weights and their sums (see `symcheck.numerics.transient.poisson`)."""

COMPONENT_STATES = 20_000_000
"""States among which the client finds end components at most, in 1 to 2 GB."""

SAVING_SHARE = 0.1
"""Share of the time of an iteration in which checkpoints are written."""

RESTART_SECONDS = 30.0
"""Time for which a lost worker is waited for before another one takes over its part."""

POLLING_SECONDS = 0.02
"""Time between two looks whether a part is created, which takes as long."""

MAX_LOSSES = 100
"""Losses of workers in one call after which it gives up."""
