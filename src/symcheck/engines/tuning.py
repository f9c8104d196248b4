"""Thresholds and budgets of the engines, each with its reason.

Figures: docs/benchmarks.md, on a Linux machine with two cores.
"""

from __future__ import annotations

# ----------------------------------------------------------------------------- choice of the engine

SMALL_MODEL_STATES = 50_000
"""States of the first explicit exploration: it ends before the diagram library would be loaded."""

SPARSE_MODEL_STATES = 1_000_000
"""States up to which the first exploration continues if the model has few transitions; it makes
that many states in half a second."""

SPARSE_MODEL_TRANSITIONS = 4_000_000
"""Transitions at which the first exploration stops: with more, diagrams are tried first."""

FIRST_EXPLORATION_TRANSITIONS = 1_000_000
"""Transitions up to which a model is explored before diagrams are tried for the first time. They
are made in a tenth of a second."""

FIRST_LOOKUPS = 200_000
"""Look-ups in CUDD's cache for these diagrams, which take a tenth of a second with the import. They
are enough for two thirds of the models of the benchmark set with more than 50,000 states."""

SYMMETRIC_STATES = 10_000_000
"""States up to which a model with symmetries is explored before diagrams are tried: csma with 4
stations and K=4 has 133,301,572 states and 5.6 million up to symmetry."""

SYMMETRIC_STATES_PER_PERMUTATION = 250_000
"""The same per permutation: few permutations save little, and diagrams may do better."""

INITIAL_CANDIDATES = 10_000_000
"""Valuations that explicit exploration may try to find the initial states of `init … endinit`."""

SELECTION_TURNS = ((3_000_000, 4_000_000), (20_000_000, 30_000_000))
"""Turns of the automatic choice: (look-ups in CUDD's cache for diagrams, states for explicit
exploration). Two million look-ups take about a second."""

MATERIALIZED_STATES = 10_000_000
"""States up to which an MDP that was built as diagrams is checked on compressed rows: prob0 and
prob1 of an MDP are nested fixpoints, which are slow on diagrams."""

MAX_NODES_PER_STATE = 0.5
"""Diagram nodes per state above which a diagram does not compress the states: packed rows of bits
then take less memory."""

MATRIX_ENTRY_BYTES = 12
"""Memory of an entry of compressed rows: an int32 column and a float64 value."""

ROUNDED_BITS = 30
"""State bits read by the argument of one ceil, floor or round above which its diagram is not
tried: it would have up to 2**30 nodes."""

ROWS_MEMORY_SHARE = 0.3
"""Share of the machine's memory that compressed rows may take; above it blocks replace rows. Until
takes about twice the memory of the rows, for a copy without known states and its vectors."""

EXPLORATION_MEMORY_SHARE = 0.7
"""Share of the machine's memory that explicit exploration may take where diagrams do not help."""

# ---------------------------------------------------- diagrams that do not compress, and products

SMALL_DIAGRAM_NODES = 200_000
"""Nodes of the state set up to which the matrix is a diagram: every form of it is made quickly."""

EXPLORED_STATES = 10_000_000
"""States up to which explicit exploration gives the rows if diagrams do not compress the states."""

DECODED_STATES = 65_536
"""States whose bits are decoded at a time, which bounds the memory needed beside their values."""

PRODUCT_PAIRS = 2**33
"""Pairs (state, automaton state) that an explicit product may have to mark, one byte each."""

# ---------------------------------------------------------------------------------- explicit engine

STATES_PER_UNKNOWN = 3
"""Solve on the full matrix if it has at most this many times as many states as there are unknowns;
otherwise extract a submatrix. On nand with N=40, K=3 the full matrix takes 0.41 s and the submatrix
0.73 s."""

CACHED_SETS = 16
"""Sets of states that the explicit engine keeps: several properties use the same labels."""

CACHED_SETS_BYTES = 2**28
"""Memory that these sets may take."""

KEPT_TRANSPOSE_TRANSITIONS = 1_000_000
"""Transitions above which the transposed matrix is freed while equations over most of the states
are solved: below, it takes at most a few megabytes."""

# ---------------------------------------------------------------------- graph questions on diagrams

GRAPH_LOOKUPS = 500_000
"""Look-ups in CUDD's cache (a quarter of a second) that a graph question may take on diagrams
before it is answered on rows, if these are few: writing up to 10 million transitions takes about
as long."""

FEW_TRANSITIONS = 10_000_000
"""Transitions up to which a graph question that is slow on diagrams is answered on the rows of all
states (120 MB), unless the engine has a lower limit for rows."""

GRAPH_LOOKUPS_PER_STATE = 0.035
"""Additional look-ups per state if the alternative is a reduced system: a third of the work that
its construction takes. On csma with 84,856,004 states it takes 8 seconds, and a million look-ups
take 0.8 seconds."""

BSCC_PIVOTS = 12
"""Pivots of the search for bottom components on diagrams; then the rows of the remaining states
are enumerated. The number matters little: crowds with 5 members takes 18 to 27 ms for 0 to 100
pivots, least for few."""

END_COMPONENT_STATES = 1_000_000
"""States up to which the end components of a set are found on their rows; almost-sure acceptance
in larger sets is a fixpoint on diagrams."""

CACHED_ANSWERS = 4
"""Answers to graph questions that are kept: a query for values asks for prob0 and prob1 again."""

CACHED_BACKWARD_SEARCHES = 4
"""Results of backward searches that are kept: prob0 and prob1 of one formula share them."""

# ------------------------------------------------------------------ deterministic-state elimination

ELIMINATION_STATES = 5_000_000
"""States from which on deterministic states may be eliminated: below, the rows of all states are
written quickly."""

ELIMINATION_MEMORY_SHARE = 0.5
"""Share of the machine's memory that a reduced system may take."""

# ----------------------------------------------------------------------- acyclic chains on diagrams

ACYCLIC_STATES = 2_000_000
"""Unknowns from which on an acyclic chain is solved on diagrams: with fewer, arrays are faster."""

ACYCLIC_NODES = 30_000_000
"""Nodes that all products of the solution may produce together, for up to 100 million unknowns. The
solution on arrays is the alternative; with more unknowns, the budget grows in proportion."""

ACYCLIC_NODES_PER_STATE = 0.25
"""Nodes per unknown that all products may produce together. Where the method pays, it takes a tenth
of that, and the solution on arrays takes less than five times as long as using up this budget."""

ACYCLIC_NODE_SHARE = 0.02
"""Nodes per unknown of a single vector above which its diagram does not compress the values."""

# -------------------------------------------------------------------- values and sweeps on diagrams

FEW_LEAVES = 256
"""Different values up to which a function is stored as constants on sets of states. Sums of such
functions have many sets: on nand with N=40, K=3 a sum of three variables takes 2.2 s, and 0.8 s as
an array. But an array of 50 million states takes 400 MB."""

MANY_STATES = 50_000_000
"""States above which a function is stored as constants on sets, whatever its number of values."""

CONSTANT_PIECES = 20_000
"""Constants on sets that the values of a quotient may be lifted to."""

LISTED_STATES = 10_000_000
"""States (or transitions) that are listed at most: more take minutes and gigabytes in Python."""

LUMPING_MEMORY = 2 * 2**30
"""Bytes that a partition of diagrams and its signatures may take, unless the caller says more."""

SWEEP_STEPS = 10
"""Products of diagrams in a sweep of the MTBDD engine, before the vector becomes an array again. On
nand with N=20, K=2, interval iteration takes 1.48 s with 1 product, 1.36 s with 10 and 1.22 s with
100; more products delay the test of convergence."""

# ------------------------------------------------------------------------------------------ rewards

CANCELLATION = 64.0
"""A sum of rewards keeps its digits if the absolute values of its terms are at most so many times
as large: its relative error is then below 1e-13."""
TABLE_BITS = 14
"""Bits of the variables of an expression up to which diagrams tabulate it: see `EncodingLimits`."""
