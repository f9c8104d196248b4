"""Thresholds and budgets of the checks, each with its reason.

They count work (operations, states, entries, bytes), never time.
"""

from __future__ import annotations

# Comparisons with thresholds, and rational arithmetic where floating point does not decide.
REFINED_ACCURACIES = (1e-9, 1e-12)
"""Values of epsilon that are tried in turn if a comparison is undecided."""
PROVED_EQUATIONS = 300
"""The most equations of a linear program that is proved in rational arithmetic by default."""
LARGE_MODEL_STATES = 100_000
"""In models with at least so many states, values that are not requested are not computed."""
MAX_COMPARED_STATES = 1_000_000
"""The most relevant states at which the accuracy of 1 - p is compared with the requested one."""
QUANTILE_BOUND = 1 << 24
"""The largest bound that the search for a quantile tries."""
QUANTILE_ROUNDS = 64
"""Where perhaps no bound is the answer, bounds are tried up to so many times the cost of as many
steps as there are states. A limit that is approached more slowly is left open, with an error."""
CONDITIONAL_STATES = 1000
"""The most states of an MDP for which conditional probabilities are computed, one by one."""
# Bounds on rewards (measures/reward_scaling.py).
LARGEST_DENOMINATOR = 1_000_000
"""Rewards are multiples of a common step if they are fractions with denominators up to this."""
REWARD_LEVELS = 100_000_000
"""The largest bound on a reward, in steps."""

STRATEGY_ENTRIES = 20_000_000
"""Entries of the product of a model with the counters of a strategy; an entry takes 16 bytes."""

EXPLICIT_ENTRY_BYTES = 20
"""Memory of an entry of the matrix and of its transposed graph, for algorithms that need rows."""
EXPLICIT_ROW_BYTES = 24
"""Memory of a row, and of a state beside its rows."""
LISTED_ROWS = 100_000_000
"""The most states, choices and transitions that a model on diagrams is listed with for a strategy
or a counterexample. Exploring them takes half a minute; the engine explicit has no such limit."""

# Rewards that are lost where a target is missed (measures/ended_reward.py).
FIRST_LEVELS, MOST_PAIRS, MOST_EXACT_PAIRS = 16, 200_000, 500
"""Rewards that a strategy remembers at first, in steps of the rewards; and the most pairs of a
state and such a reward, in doubles and in rationals."""

# LTL formulas (omega_regular/).
PARITY_EXPONENTS = (2, 4, 6, 20)
"""Powers of ten: a run of a parity game ends with such a probability where it should not be, in the
game whose strategies are tried."""
ATOMS_AS_LETTERS = 8
"""With at most this many atoms, letters are valuations of the atoms; with more, the valuations that
occur in the model are numbered."""
LETTERS = 1 << 14
"""Valuations of the atoms that may occur in the model."""
NESTED_STEPS = 2000
"""Largest bound on steps within a formula with nested operators, which becomes as many formulas."""

# Quotients by bisimulation (bisimulation/on_quotient.py).
ENTRY_BYTES = 12
"""Memory of an entry of compressed rows."""
LUMPED_ROWS_BYTES = 2**30
"""Largest compressed rows that are materialized if diagrams cannot be lumped."""
LUMPED_ROWS_STATES = 20_000_000
"""Most states of such rows."""
DIAGRAMS_FIRST_STATES = 1_000_000
"""Above this many explicit states, diagrams are lumped first if they exist."""
STATES_PER_BLOCK = 4
"""With fewer states per block on average, lumping explicit states is cheaper than diagrams."""
SHARED_STATES_PER_BLOCK = 2
"""With fewer states per block on average, a shared quotient does not pay off."""
LUMPING_OPERATIONS = 40_000_000
"""Operations on diagrams if explicit states are the alternative: some twenty seconds. csma 3/4,
the hardest one that was measured, takes 35 million."""
LUMPING_OPERATIONS_WITHOUT_ALTERNATIVE = 1_000_000_000
"""Likewise without an alternative: some ten minutes."""

# Counterexamples (explanation/).
COUNTEREXAMPLE_PATHS = 1000
"""Paths of a counterexample, unless another number is asked for."""
PATH_STEPS = 20_000_000
"""The most states times steps of a bounded path formula: two numbers are stored for each."""
COMMAND_STATES = 20_000
"""The most states of a model whose commands are found again, state by state, in Python."""
COMMAND_SET_CHECKS = 2000
"""Sets of commands that are checked before a small set takes the place of a smallest one."""

INTEGER_BITS = 300_000
"""Bits of the common denominator after all steps up to which exact steps are made in integers."""
REWARD_PAIRS = 10_000_000
"""Pairs of a state and a reward that a certificate of a bound on rewards may be about."""

# Beliefs of partially observed models (beliefs/).
BELIEFS = (500, 4_000, 32_000)
"""Beliefs that are kept exactly in each round, until the bounds are close enough."""
GRID_RESOLUTION = 4
"""The first resolution of the grid beyond them, which is doubled while it has few points."""
FINEST_GRID = 64
"""The last resolution; finer grids of few points take long, as they are explored step by step."""
GRID_BELIEFS = 4
"""Points of the grid for each belief that is kept exactly, beyond a first thousand."""
SUPPORTS = 20_000
"""The most sets of possible states that are explored; beyond, strategies remember observations."""
SUPPORT_PAIRS = 400_000
"""The most states in all of these sets."""
BOUNDED_BELIEFS = 400_000
"""The most beliefs within a bound on steps."""
POLICY_ROUNDS = 12
"""The most improvements of a strategy with little memory."""
POLICY_STEPS, POLICY_DISCOUNT = 64, 0.95
"""How far expectations over the runs of a strategy look ahead."""

# Models that are explored in part (truncation.py).
TRUNCATION_SHARE = 0.25
"""The share of epsilon for what leaves the explored states, and for the accuracy on them."""
TRUNCATION_SHIFTS = (6.0,)
"""Laplace shifts of the estimates of what leaves them; the least one counts."""
TRUNCATION_REWARD_SHIFTS = (6.0, 40.0)
"""Those for rewards, which weight what leaves by bounds that may be large."""
TRUNCATION_STATES = 8_000_000
"""States from which on the region does not grow any more: about a GB."""
TRUNCATION_USELESS = 0.5
"""What leaves a large region makes bounds useless from here on."""
APPROACHING_ROUNDS, APPROACHING = 4, 0.99
"""Rounds, in which a region grows to six times its size, and the share of the distance between both
bounds to which it has to shrink meanwhile, if there is no bound on time."""
APPROACHED = 1e-100
"""A distance that is not reduced further."""
UNKNOWN_STATES = 1_000_000
"""States from which on the region does not grow any more while nothing is known."""
TRUNCATION_LEAST = 1e-250
"""What leaves a region is not reduced further than this."""
