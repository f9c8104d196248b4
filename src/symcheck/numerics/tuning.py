"""Thresholds and budgets of the numerical methods, each with its reason.

They count work (operations, entries, steps, bytes), never time. docs/benchmarks.md lists what the
specialised algorithms gain on the tasks that they were made for.
"""

from __future__ import annotations

import math

# Floating-point arithmetic.
UNIT_ROUNDOFF = 2.0**-53
"""Relative error of one rounded operation on doubles."""
SMALLEST_DIVISOR = 1e-300
"""Widths are relative to at least this, so that a value of 0 has a finite relative width."""
ADDED_CONSTANT, LEAST_ACCURATE = 1e-290, 1e-270
"""Where values are below the range of doubles: what is added to the constants, and the values below
which no accuracy is required then, both relative to the largest constant."""
UNDERFLOW_RISK = 1e-290
"""Values below it may differ from their bounds by underflow, not only by rounding."""
CANCELLATION = 8.0
"""A difference of two values that are exact up to rounding is so too if their sum is at most so
many times as large."""
ROUNDING_WIDTH = 1e-9
"""Bounds of this relative width that follow from exact steps differ by rounding; wider ones, by
underflow."""
CONSTANT_WIDTH = 1e-11
"""Constants with bounds of at most this relative width differ by rounding."""
STATES_PER_SLICE = 65_536
"""States processed at a time where temporary arrays of all states would take too much memory."""

# Linear systems: topological method (linear/methods/topological.py).
SMALL_COMPONENT_STATES = 64
"""Components without choices of at most so many states are eliminated in a full matrix."""
LARGE_COMPONENT_STATES = 20_000
"""Larger components try BiCGStab before elimination, because elimination fills in."""
CHEAP_ENTRIES = 20_000_000
"""Entries that sweeps may visit before other methods are tried: some hundredths of a second."""
EARLY_OPERATIONS_PER_ENTRY = 200
"""Operations per entry that elimination may need before any sweep; sweeps need as many."""
EARLY_OPERATIONS_PER_ENTRY_LARGE = 20
"""Likewise for large components, after BiCGStab."""
ELIMINATION_STATES = 250_000
"""Larger components are not eliminated at length, because they fill in."""
ELIMINATION_ENTRIES = 5_000_000
"""Entries up to which elimination is tried; its lists take several times the memory of the rows."""
ELIMINATION_OPERATIONS = 4_000_000_000
"""Operations after which an elimination is abandoned."""
RELAXED_TOLERANCES = (10.0, 100.0, 1000.0, 10_000.0)
"""Factors of the requested width if rounding prevents the proof of closer bounds."""

# Linear systems: extrapolated sweeps (linear/extrapolation.py).
SWEEPS_BEFORE_FIRST_POLICY = 16
"""Sweeps over all choices before the first policy is evaluated."""
EXTRAPOLATION_STEPS = 40
"""Extrapolation steps per policy."""
EVALUATION_ACCURACY = 0.03
"""A policy is evaluated until this part of the last improvement remains."""
SLOW_EVALUATIONS = 3
"""Evaluations in a row that extrapolation does not finish before BiCGStab is tried."""
SHIFTED_PATIENCE = 250
"""BiCGStab steps for a chain that is hardly left within which the residual must fall by a factor of
ten: it stays on a plateau for up to 200 of them, and falls quickly after."""
STEPS_AFTER_BICGSTAB = 4
"""Extrapolation steps that make values close which are much smaller than the others."""
SHIFTED_ACCURACY = 1e-4
"""A policy is evaluated by BiCGStab until this part of the last improvement remains."""
EXTRAPOLATION_ROUNDS = 150
"""Policies, or slices of the evaluation of a chain, before the method gives up."""
EXTRAPOLATION_PATIENCE = 25
"""Rounds without progress before the method gives up."""
SMALLEST_CHANGE = 2e-15
"""Smaller relative changes are due to rounding."""

# Linear systems: BiCGStab (linear/preconditioned_bicgstab.py, linear/subsystem.py).
MIN_COSINE = 0.7
"""Least cosine for the stabilising step (Sleijpen & van der Vorst 1995, who recommend 0.7)."""
RESTART_REDUCTION = 1e-11
"""BiCGStab restarts from the true residual once the residual is this part of its maximum: smaller
residuals may be its rounding error."""
BICGSTAB_PATIENCE = 40
"""Steps within which the residual must fall by a factor of ten. Polling, mapk and herman need 25 to
48 steps for the whole solution; grids whose values differ by many orders of magnitude do not
converge."""
EARLY_BICGSTAB_STEPS, BICGSTAB_STEPS = 100, 400
"""Steps of BiCGStab for a relative solution: until a tenth of the residual remains, and in all."""
THREADED_TRIANGLES, ROW_BLOCKS, MIN_BLOCK_ROWS = 1_000_000, 1_024, 256
"""Entries of a matrix from which on threads solve with its triangles; most blocks of rows, which
threads claim one after the other; and the rows of a block at least."""
VECTOR_PARTS = 4
"""Parts of a vector that threads update at the same time."""
WEIGHT_RESIDUAL = 0.3
"""Relative residual of the weights of a certificate, which need to be approximate only."""
POLICY_ROUNDS = 500
"""Policies that policy iteration evaluates."""

# Turn-based games (linear/games.py).
GAME_ACCURACIES = (1e-2, 1e-5)
"""Parts of the requested width to which decision processes are solved: first, and if the bounds of
the game are not close enough."""
GAME_ROUNDING = 1e-13
"""A row whose value is relatively better by less than this may be so by rounding only."""
GAME_CHANGE = 1e-10
"""Value iteration that looks for strategies ends at this relative change."""
GAME_SWEEPS, GAME_ENTRIES = 100, 100_000_000
"""Its sweeps at least, and the entries that it may visit: a second."""
GAME_SWEEP_WORK = 400
"""A sweep takes as long as so many entries, even if a game has few."""
DEFLATION_INTERVAL = 64
"""Most iterations between two searches for end components."""

# Linear systems: products only (linear/bellman.py, methods/interval.py, methods/optimistic.py).
TWO_THREADS_STATES = 100_000
"""From so many states on, lower and upper bounds are swept in two threads: starting a thread costs
more than a sweep over fewer states."""
STALL_CHECK_INTERVAL = 100
"""Iterations between checks whether the bounds still change at all."""
GUESS_ROUNDS = 50
"""Least number of iterations to verify a guessed upper bound."""

# Uniformisation (transient/uniformization.py).
CHECK_INTERVAL = 50
"""Steps between tests of the stopping criteria; later a twentieth of the steps made."""
WINDOW = 2e6
"""Poisson weights on each side of the mode from which on the smallest ones are left out: those of
rates above 3e9. A rate of 5e11 would otherwise take gigabytes."""
LARGEST_POISSON_RATE = 1e14
"""Its window takes a gigabyte. Numbers up to 9e15 are exact in doubles."""
UNDERFLOW_BOUND = 1e-300
"""Added to upper bounds: 1e7 steps with 1e3 roundings each lose less than this to underflow. Values
that are proved to be smaller are not computed."""
TRUNCATION_ENTRIES = 1e10
"""Entries that uniformisation would visit, from which on truncation is tried."""
TRUNCATION_SHIFTS = (20.0, 5.0)
"""Laplace shifts a of the two rounds of truncation: the first is quick, the second keeps less."""
TRUNCATION_MAX_KEPT = 0.5
"""A truncation that keeps a larger share of the states is not used."""
TRUNCATION_TRIAL_SWEEPS, TRUNCATION_HOPELESS = (2, 2, 4, 8), 0.7
"""Sweeps in both directions, and the share of the states that matter from which on no more is done:
polling (all after two), mapk N=7 (77 % after 16). On cluster, where truncation succeeds, it is 42 %
at most."""
TRUNCATION_FIRST_SWEEPS = 100
"""Sweeps after which BiCGStab has a guess to start from. After 30, it diverges on cluster N=256."""

SERIES_ENTRIES, LONG_SERIES_ENTRIES = 1e10, 3e12
"""Entries that are visited of a horizon with more than the second number: the bounds so far are
then the result. They take some fifteen seconds; the second number an hour."""
TRANSIENT_ROWS_STATES = 10_000
"""States up to which engines without rows write them for transient analysis; for long horizons, all
that they are ready to write: rational Krylov subspaces need rows."""
LIMIT_STEPS = 10_000
"""Steps from which on values are compared with those without a time bound."""

FIRST_STEP_CHECK, STEP_CHECKS, STEP_ENTRIES = 1_000, 8, 30_000
"""Steps of a step-bounded property before the rest is estimated; estimates, each after half as many
steps again, that show how fast it becomes less; and the entries that a step costs at least: it is a
call of some functions."""
EXACT_BITS, EXACT_DIGITS = 20_000, 3e6
"""Bits of a fraction from which on its growth is noticed, and the digits after all steps,
estimated, with which an exact computation ends."""

# Repeated squaring (transient/squaring.py).
SQUARING_STATES = 300
"""States up to which matrices are full: a squaring of 300 takes a quarter of a second."""
SQUARING_STEPS = 10_000
"""Steps up to which vectors are multiplied, whose results have no wider bounds than rounding."""
SQUARING_EXPONENT = -10
"""The base-2 logarithm of the jumps in the shortest time, so that few terms are needed."""
SQUARING_TERMS = 8
"""Terms of the shortest time that are expected."""
SQUARING_REST = 1e-25
"""The rest of these terms, relative to the least probability of a jump."""
ENTRY_ERROR = 8.0 * UNIT_ROUNDOFF
"""Relative error of a probability or rate of a model: some roundings of its expression."""

# Forward uniformisation (transient/forward.py).
FORWARD_ENTRIES = 2e9
"""Entries that uniformisation would visit, from which on the active states are followed first."""
FORWARD_ACTIVE_SHARE = 0.25
"""Share of the states that may be active: more gain nothing."""
FORWARD_WORK = 2_000_000_000
"""Entries that may be visited, and that the rest of the steps may be expected to visit."""
FORWARD_THRESHOLD = 1e-30
"""Probabilities that are dropped at first: in tandem c=1023, at most 1060 of 2e6 states have more
at the same time."""
FORWARD_REFINEMENT = 1e-20
"""Factor of the threshold, or a smaller one, if more was dropped than the accuracy permits."""

# State-space truncation (transient/state_space_truncation.py).
TRUNCATION_SWEEPS = (600, 1_000, 2_000, 20_000)
"""Gauss-Seidel sweeps for the resolvent, in turn in the order of components and in that of distance
from the source; each goes on from the last. Tandem, for which BiCGStab diverges, needs up to 900 of
the second alone."""
TRUNCATION_SLACK, TRUNCATION_RESIDUAL = 0.02, 0.006
"""What is added to the right of the equations that BiCGStab solves, and the residual to reach, both
relative to the Laplace shift."""
TRUNCATION_SOLUTIONS, TRUNCATION_EARLY_STEPS, TRUNCATION_DIVERGED = 3, 60, 10.0
"""How often a solution becomes the guess of the next; the steps of BiCGStab after which at most a
tenth of the residual may remain; and the residual, relative to the guess, with which it gives up.
On cluster, 20 to 60 steps replace 1,100 sweeps; on tandem it has given up after 10."""

EXPONENTIAL_ROUNDINGS = 4_000
"""Unit roundoffs that the exponential of a difference of up to 700 is wrong by, at most."""

# Supermartingales for tiny values (transient/supermartingale.py).
SUPERMARTINGALE_SHIFT = 20.0
"""Laplace shift a. A larger one makes the drift stronger, and the bound e^a times as large."""
SUPERMARTINGALE_PASSES = 20
"""Passes for the costs at most: in the order of distance, the first finds nearly all of them."""
SUPERMARTINGALE_FREE = 0.03
"""The part of the cost from the states of interest that is free, next to the reward."""
SUPERMARTINGALE_EXPONENTS = (1.0, 1.4, 1.2, 0.8, 1.6, 0.6, 1.8, 0.4)
"""Exponents that are tried in turn. Where a chain moves along a line with equal probabilities
below 1/2 of each step towards the reward, 1 is always enough."""

# Rational Krylov subspaces (transient/rational_krylov.py).
KRYLOV_STEPS, KRYLOV_ENTRIES = 4e3, 5e9
"""Steps of uniformisation, and entries it would visit, from which on rational Krylov subspaces are
tried. Mapk N=3 (6e9 entries) takes a quarter of the time with them; on cluster N=32 (4e9), where
uniformisation ends early, the attempt costs half as much again; on p53 (3e3 steps), it takes five
times as long as uniformisation."""
SMOOTHING_STEPS = 200.0
"""Steps of uniformisation that smooth the initial values before."""
POLES: tuple[float, ...] = (15.0,)
"""The poles of the rational functions, times the time, in turn."""
WEIGHTED_POLES: tuple[float, ...] = (20.0, 150.0, 800.0)
"""Likewise for values divided by weights, where fast components persist."""
ELIMINATION_POLE = 10.0
"""Likewise for elimination, which factorises one matrix only."""
SUBSPACE_SIZES = (8, 10, 12, *range(14, 25), 26, 28, 30, 33, 36, 40, 44, 48, 52, 56, 60)
"""Dimensions of the subspace at which the defect is computed."""
LARGER_SUBSPACE_SIZES = (75, 90, 110, 130, 160, 200)
"""Further dimensions with elimination, where a vector is cheap."""
KRYLOV_SLICE_STATES = 8_192
"""States whose part of the basis is processed at a time: it fits into the cache of a core."""
VECTORS_BEFORE_JUDGEMENT, RECENT_VECTORS = 24, 3
"""The size of the subspace from which on convergence is extrapolated, and the vectors by which the
recent rate is measured, at least."""
SPURIOUS_GROWTH = 10.0
"""A bound that is so many times the last one comes from a projection that is not used."""
MISSED_WIDTH, STALLED = 1e-3, 0.5
"""A subspace that misses the accuracy is the result if its bounds are closer than the first number
relative to the value, and uniformisation would visit more than `AFTER_KRYLOV_ENTRIES`; and the part
of the last error above which still larger subspaces gain nothing but rounding errors."""
AFTER_KRYLOV_ENTRIES = 2e10
"""See there; some twenty seconds."""
KRYLOV_BICGSTAB_STEPS = 400
"""Steps of BiCGStab per vector."""
KRYLOV_ELIMINATION_STATES, KRYLOV_ELIMINATION_OPERATIONS = 50_000, 1500
"""States up to which elimination replaces BiCGStab, and its operations per entry."""
WEIGHT_ELIMINATION_OPERATIONS = 1500
"""Operations per entry of the elimination for the weights."""
IMPORTANCE_RESIDUAL = 1e-8
"""Residual of the weights, relative to a guess."""
VECTOR_RESIDUAL = 1e-12
"""Relative residual of the first vectors of the subspace."""
VECTOR_SHARE = 3e-3
"""Part of the error that the residual of a later vector may cause."""
IMPORTANCE_SHIFT = 0.25
"""Laplace shift a of the weights: values at different times differ by at most a factor exp(a), by
which the bound on the error grows. With 1, it does not become small enough on cluster N=64
(repairs)."""
MAX_VALUE_RANGE = 300.0
"""Greatest ratio of the largest value to the least value of interest: beyond, the error of the
largest entry says too little about the states of interest."""
COLLOCATION_DEGREE = 10
"""Degree of the polynomials in time."""
COLLOCATION_INTERVALS = 150
"""Intervals of time at most."""
SAMPLES = 4 * COLLOCATION_DEGREE
"""Angles at which a polynomial is sampled to bound its maximum."""
SAMPLING_FACTOR = 1.0 / math.cos(0.5 * math.pi * COLLOCATION_DEGREE / SAMPLES) * (1 + 1e-9)
"""The maximum of a polynomial is at most this times that of the samples (Ehlich & Zeller 1964)."""

# Stationary distributions and long-run averages (long_run/stationary.py).
STATIONARY_OPERATIONS = 3_000_000_000
"""Operations of an elimination for a stationary distribution."""
SMALL_CHAIN_STATES = 2_000
"""Chains of at most so many states are eliminated before anything else is tried."""
QUICK_OPERATIONS_PER_ENTRY = 50
"""Operations per entry of an elimination that is tried in any case."""
POISSON_PATIENCE = 20
"""BiCGStab steps between computations of the bounds while the residual does not fall."""
POISSON_STALL_STEPS = 600
"""BiCGStab steps without half the residual before the method gives up: where a chain drifts, the
residual stays for as many steps as the way is long."""
POISSON_RESIDUAL_DROP = 0.5
"""The bounds are computed again once the residual is this part of that at the last time."""
EIGENVALUE_SHIFT = 0.2
"""The eigenvalue 0 is moved to this part of the diagonal, among the others."""
OCCUPATION_SWEEPS = 2
"""Sweeps that approximate the stationary distribution for that shift."""

# Chains that drift towards a few states (long_run/drift.py).
DRIFT_STATES = 200_000
"""States from which on a core is looked for."""
CORE_JUMPS, CORE_VISITED = (500_000, 200_000), 5_000
"""Jumps of a random path to the core, and then within it; and how many states it may visit there.
In tandem c=1023 it visits 50, in polling and kanban more than it may."""
CORE_FREQUENT, CORE_SHARE = 0.01, 0.1
"""States with this part of the most visits have no cost, and the greatest share of the states that
the core may have."""
CORE_UNDECIDED, CORE_RISE = 10.0, 40.0
"""The greatest logarithm of w where Q w < 0 is not proved, and how much further it rises within the
core: e^40 outweighs solutions of 1e12 with a relative accuracy of 1e-6. The core of tandem
c=1023 has 7,208 of 2 million states."""
DRIFT_EXPONENTS = (0.3, 0.15, 0.6)
"""Exponents that are tried in turn: on tandem, those up to 0.3 will do."""
DRIFT_PASSES, DRIFT_RAISES, DRIFT_MARGIN = 2, 2, 1e-5
"""Passes that lower costs, and then raise some; and the drift at which those aim, as a share of the
rate of leaving."""

# Mean payoff (long_run/mean_payoff.py).
VALUE_ITERATIONS_BEFORE_POLICIES = 2_000
"""Value iterations before policy iteration is tried."""
MEAN_PAYOFF_POLICIES = 60
"""Policies that are evaluated."""
DIRECT_EVALUATION_STATES = 100_000
"""States up to which a policy is evaluated by a sparse factorisation."""
APERIODIC_STAY = 0.5
"""Probability with which the aperiodic variant of an MDP stays where it is."""

# Reward-bounded reachability (reward_bounds/).
INVERSE_STATES = 1_500
"""States of a cycle without choices up to which its equations are inverted once for all epochs."""
INVERSE_MIN_STEPS = 30.0
"""Expected steps on a cycle from which on the inverse is quicker than sweeps."""
INVERSE_BYTES = 512 << 20
"""Memory of all inverses."""
EPOCH_BYTES = 4 << 30
"""Memory of the values of the epochs that are kept."""
EPOCH_SWEEPS = 200_000
"""Sweeps over a cycle in one epoch; each epoch starts with the values of the one before."""
EPOCH_ENTRIES_PER_CALL = 50_000_000
"""Entries that are visited between calls of the observer."""
UNFOLDED_ENTRIES = 200_000_000
"""States or entries of a model with an unfolded reward dimension."""

TIGHT_ROWS = (1e-13, 1e-11, 1e-9, 1e-7, 1e-5, 1e-3)
"""Room, relative to the value, below which a row of a certificate is given more room."""
WIDEST_ROOM = 1e-2
"""Values of a certificate move by at most this share of what is earned of them later."""
ROOM_GROWTH = 16.0
"""Factor between two attempts to give rows room."""
GRID_BITS = 60
"""Bits of the smallest value of a certificate."""
GAIN_ROOM = (1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6)
"""Room that the gain of a certificate gives its bias, relative to the greatest gain."""
BIAS_ROOM = 1e-10
"""Room that transient states get in the bias of a certificate, relative to the greatest bias."""
EQUAL_GAINS = 1e-8
"""Difference of the gains of a certificate, relative to the greatest one, that is none."""
MORE_BITS = 80
"""Bits by which a refined bias is finer than one in doubles."""
REFINEMENTS = 4
"""Corrections of a bias by its exact residual."""
BIAS_POLICIES = 100
"""The most policies whose bias is computed for a certificate."""

GAIN_RATE = 1.05
"""Of the greatest exit rate: the rate of jumps, some of which change nothing (no periods)."""
GAIN_JUMPS = (8, 16, 32, 64, 128, *[256] * 64)
"""Jumps between two looks at the bounds of a long-run average; then other methods follow."""

MEAN_PAYOFF_SECANTS = 60
"""Secants that approach a long-run average per unit of time; a few suffice."""

TIMED_JUMPS = 16.0
"""Mean number of jumps of an interval, at least; more make intervals fewer, but each longer."""

TIMED_SHORT = 1.0
"""With fewer jumps on average, what other choices gain is bounded for each instant instead."""

TIMED_POWERS = 40
"""For so many jumps, a number for each and each state would take too much memory."""

TIMED_FIRST_JUMPS = 16.0
"""Mean number of jumps in the first interval of time-bounded values of Markov automata."""

TIMED_MOST_JUMPS = 4096.0
"""At most so many in an interval, as its steps are lost if it has to be divided."""

TIMED_LEAST_JUMPS = 1e-9
"""Shorter intervals are not divided: rounding decides there."""

TIMED_LEVELS = 200
"""Rounding is counted level by level up to so many choices in no time."""

TIMED_JUMP_WORK = 50
"""A jump takes as long as so many products, even if a model has few entries."""

TIMED_WORK = 4e10
"""Products of an entry and a value after which bounds are not made closer (a minute or so)."""
