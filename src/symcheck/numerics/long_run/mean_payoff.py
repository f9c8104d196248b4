"""Long-run average rewards of Markov decision processes, with certified bounds.

All states of an end component have the same best average (its gain), as each can be reached almost
surely from each. For *any* vector h,

    min over s of (T h - h)(s)  <=  best average  <=  max over s of (T h - h)(s),
    where T h = max over rows of (r + P h)

(Odoni 1969; Puterman 1994, 8.5 and 9.5), so h may be any approximation: here, it comes from value
iteration on the aperiodic variant of the process, or from policy iteration where that is slow.
Under every strategy, a run stays in some end component from some time on, almost surely. So the
value of a state is the optimal expected gain of the end component that is reached (Chatterjee &
Henzinger 2011; Ashok, Chatterjee, Daca, Kretinsky & Meggendorfer 2017).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix, first_best, starts_of
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress
from symcheck.numerics.linear.rational import solve_chain
from symcheck.numerics.settings import Accuracy, Settings

__all__ = ["Gain", "Gains", "component_gains", "gain_policy", "mec_quotient"]


@dataclass(frozen=True)
class Gain:
    """Bounds on the gain of an end component: floats, or equal rationals.

    `iterations` counts those of value iteration.
    """

    lower: float | Fraction
    upper: float | Fraction
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class Gains:
    """Bounds on the gain of each maximal end component.

    Attributes:
        parts: the maximal end components.
        lower, upper: the bounds, float64[parts.count] or rationals.
        iterations: the iterations of all components.
        largest: the number of states of the largest component that was solved numerically.
    """

    parts: graph.EndComponents
    lower: Numbers
    upper: Numbers
    iterations: int
    largest: int


@dataclass(frozen=True, eq=False)
class _EndComponent:
    """An end component with the rows that stay inside; rewards, float64[rows], are maximised.

    states, rows_of: its states and rows in the whole matrix.
    """

    matrix: SparseMatrix
    rewards: Numbers = field(repr=False)
    states: Int32s = field(repr=False)
    rows_of: Int64s = field(repr=False)

    @property
    def groups(self) -> Int64s:
        """Rows of each state."""
        assert self.matrix.groups is not None
        return self.matrix.groups

    def rows(self, h: Numbers) -> Numbers:
        """The value r + P h of each row."""
        return np.asarray(self.matrix.multiply(h) + self.rewards)

    def best(self, rows: Numbers) -> Numbers:
        """The greatest value of the rows of each state."""
        return np.asarray(np.maximum.reduceat(rows, self.groups[:-1]))

    def rounding_error(self, h: Numbers) -> float:
        """A bound on the rounding error of T h - h; 0 in rational arithmetic."""
        if self.matrix.exact:
            return 0
        longest = int(self.matrix.lengths.max())
        return float(
            (longest + 6) * 2.0**-52 * (np.abs(self.rewards).max() + 2.0 * np.abs(h).max())
        )


def component_gains(
    matrix: SparseMatrix,
    rewards: Numbers,
    direction: Direction,
    settings: Settings,
    observer: Observer | None = None,
) -> Gains:
    """The optimal long-run average reward per step in each maximal end component.

    Args:
        matrix: the MDP.
        rewards: the reward of each row, float64[rows] or rationals.
        direction: maximise or minimise the average.
        settings: the accuracy.
        observer: receives the progress.

    Returns:
        Certified bounds, a quarter of epsilon apart unless rounding prevents it.
    """
    sign = -1 if direction is Direction.MIN else 1
    parts = graph.maximal_end_components(matrix, np.ones(matrix.states, np.bool_))
    lower, upper = (full(parts.count, 0, exact=matrix.exact) for _ in range(2))
    iterations = largest = 0
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    owner = graph.Incidence(matrix).owner_of_rows
    singleton = sizes == 1
    if singleton.any():
        # Components of one state: the best self-loop.
        best = full(parts.count, -np.inf, exact=matrix.exact)
        np.maximum.at(best, parts.of[owner[parts.rows]], sign * rewards[parts.rows])
        lower[singleton] = upper[singleton] = best[singleton]
    for c, part in _larger_components(matrix, sign * rewards, parts, sizes, owner):
        gain = _gain(part, settings, observer)
        lower[c], upper[c] = gain.lower, gain.upper
        iterations += gain.iterations
        largest = max(largest, part.matrix.states)
    if sign < 0:
        lower, upper = -upper, -lower
    return Gains(parts, lower, upper, iterations, largest)


def _larger_components(
    matrix: SparseMatrix, rewards: Numbers, parts: graph.EndComponents, sizes: Int64s, owner: Int32s
) -> Iterator[tuple[int, _EndComponent]]:
    """The components of more than one state, with their numbers."""
    inside = np.flatnonzero(parts.rows)
    inside = inside[np.argsort(parts.of[owner[inside]], kind="stable")]
    starts = starts_of(np.bincount(parts.of[owner[inside]], minlength=parts.count))
    index = np.full(matrix.states, -1, np.int32)
    for c in np.flatnonzero(sizes > 1).tolist():
        rows = inside[starts[c] : starts[c + 1]]
        states, counts = np.unique(owner[rows], return_counts=True)
        index[states] = np.arange(len(states), dtype=np.int32)
        inner = matrix.select(rows, index, len(states), starts_of(counts))
        index[states] = -1
        yield c, _EndComponent(inner, rewards[rows], states, rows)


def gain_policy(
    matrix: SparseMatrix, rewards: Numbers, direction: Direction, gains: Gains, settings: Settings
) -> Int64s:
    """A policy that stays in each maximal end component and attains its gain.

    Args:
        matrix, rewards, direction: see `component_gains`.
        gains: its result.
        settings: the accuracy.

    Returns:
        A row for each state, -1 outside of end components.

    Raises:
        NumericalError: a component is too large for policy iteration.
    """
    signed = -rewards if direction is Direction.MIN else rewards
    parts, owner = gains.parts, graph.Incidence(matrix).owner_of_rows
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    policy = np.full(matrix.states, -1, np.int64)
    inside = np.flatnonzero(parts.rows & (sizes[parts.of[owner]] == 1))
    order = inside[np.argsort(signed[inside], kind="stable")]
    policy[owner[order]] = order  # the greatest reward is the last
    for _, part in _larger_components(matrix, signed, parts, sizes, owner):
        n = part.matrix.states
        if not matrix.exact and n > tuning.DIRECT_EVALUATION_STATES:
            raise NumericalError(f"an end component has {n:,} states, too many for a strategy")
        finest = Accuracy(epsilon=0.0, relative=settings.relative)
        *_, chosen = _policies(part, full(n, 0, exact=matrix.exact), finest)
        policy[part.states] = part.rows_of[chosen]
    return policy


def _gain(part: _EndComponent, settings: Settings, observer: Observer | None) -> Gain:
    """Bounds on the gain of an end component."""
    top, n = part.rewards.max(), part.matrix.states
    everywhere = np.ones(n, np.bool_)
    if graph.maximal_end_components(part.matrix, everywhere, part.rewards == top).count:
        return Gain(top, top)  # a cycle earns the greatest reward at each step
    if part.matrix.exact:
        low, high, *_ = _policies(part, full(n, 0, exact=True), Accuracy(epsilon=0.0))
        if low < high:
            raise NumericalError("policy iteration for a long-run average did not end")
        return Gain(low, high)
    low, high, h, count = -np.inf, np.inf, np.zeros(n), 0
    for count in range(1, settings.max_iterations + 1):
        following = part.best(part.rows(h))
        low, high = _narrowed(part, h, following, low, high)
        if observer is not None:
            observer(Progress("value iteration", count, high - low, n))
        if _close_enough(low, high, part.rounding_error(h), settings):
            return Gain(low, high, count)
        if (
            count % tuning.VALUE_ITERATIONS_BEFORE_POLICIES == 0
            and n <= tuning.DIRECT_EVALUATION_STATES
        ):
            better = _policies(part, h, settings)
            low, high, h = max(low, better[0]), min(high, better[1]), better[2]
            if (
                _close_enough(low, high, part.rounding_error(h), settings)
                or count >= 5 * tuning.VALUE_ITERATIONS_BEFORE_POLICIES
            ):
                break
            continue
        h = tuning.APERIODIC_STAY * h + (1.0 - tuning.APERIODIC_STAY) * following
        h -= h[0]
    return Gain(low, high, count)


def _narrowed(
    part: _EndComponent, h: Numbers, following: Numbers, low: float, high: float
) -> tuple[float, float]:
    change, rounding_error = following - h, part.rounding_error(h)
    return max(low, change.min() - rounding_error), min(high, change.max() + rounding_error)


def _close_enough(low: float, high: float, rounding_error: float, settings: Settings) -> bool:
    """Whether the bounds are as close as requested, or as close as rounding permits."""
    if low == high:
        return True
    scale = max(abs(low), abs(high)) if settings.relative else 1.0
    return high - low <= max(0.25 * settings.epsilon * scale, 4.0 * rounding_error)


def _policies(
    part: _EndComponent, h: Numbers, settings: Settings
) -> tuple[float, float, Numbers, Int64s]:
    """Policy iteration from the greedy policy of h.

    Returns:
        Bounds on the gain, the last bias, and the last policy.
    """
    low, high = -np.inf, np.inf
    values = part.rows(h)
    policy = first_best(values, part.groups)
    for _ in range(tuning.MEAN_PAYOFF_POLICIES):
        policy = _unichain(part, policy, settings)
        bias = _bias(part, policy)
        if bias is None:
            break
        h = bias
        values = part.rows(h)
        best = part.best(values)
        low, high = _narrowed(part, h, best, low, high)
        better = best > values[policy] + 4 * part.rounding_error(h)
        # The bounds hold for the policy that is greedy for h, not for the one that h belongs to.
        policy = np.where(better, first_best(values, part.groups), policy)
        if _close_enough(low, high, part.rounding_error(h), settings) or not better.any():
            break
    return low, high, h - h[0], policy


def _unichain(part: _EndComponent, policy: Int64s, settings: Settings) -> Int64s:
    """A policy that reaches the best bottom component of the given one almost surely."""
    from symcheck.numerics.long_run.stationary import long_run_average

    chain = part.matrix.choose(policy)
    bottoms = graph.bsccs(chain)
    n = part.matrix.states
    target = bottoms[0]
    if len(bottoms) > 1:
        rewards = part.rewards[policy]
        index = np.full(n, -1, np.int32)
        averages = []
        for states in bottoms:
            index[states] = np.arange(len(states), dtype=np.int32)
            inner = chain.select(states, index, len(states))
            average = long_run_average(inner, rewards[states], settings)
            averages.append(average.lower)
            index[states] = -1
        target = bottoms[int(np.argmax(averages))]
    goal = np.zeros(n, np.bool_)
    goal[target] = True
    certain = graph.prob1(chain, np.ones(n, np.bool_), goal)
    if certain.all():
        return policy
    _, rows = graph.prob1e_strategy(part.matrix, np.ones(n, np.bool_), certain)
    return np.where(certain, policy, rows)


def _bias(part: _EndComponent, policy: Int64s) -> Numbers | None:
    """The bias of a policy: h with h + g = r + P h, and 0 at a state of the bottom component.

    None if the equations are singular in floating point.
    """
    chain = part.matrix.choose(policy)
    anchor = int(graph.bsccs(chain)[0][0])
    solve = _rational_bias if chain.exact else _floating_bias
    return solve(chain, part.rewards[policy], anchor)


def _rational_bias(chain: SparseMatrix, rewards: Numbers, anchor: int) -> Numbers:
    """The bias in rational arithmetic.

    The gain is the expected reward of a cycle through the anchor, divided by its expected length
    (renewal reward theorem).
    """
    n = chain.states
    index = np.arange(n, dtype=np.int32)
    index[anchor] = -1
    cycle = chain.select(np.arange(n), index, n)
    reward, length = (solve_chain(cycle, v) for v in (rewards, full(n, 1, exact=True)))
    return np.asarray(reward - reward[anchor] / length[anchor] * length)


def _floating_bias(chain: SparseMatrix, rewards: Floats, anchor: int) -> Floats | None:
    require_memory_for_scipy()
    from scipy.sparse import csc_array, csr_array
    from scipy.sparse.linalg import splu

    n = chain.states
    p = csr_array((chain.data, chain.indices, chain.indptr), shape=(n, n)).tocoo()
    keep = p.col != anchor
    diagonal = np.flatnonzero(np.arange(n) != anchor)
    data = np.concatenate((-p.data[keep], np.ones(n - 1), np.ones(n)))
    rows = np.concatenate((p.row[keep], diagonal, np.arange(n)))
    columns = np.concatenate((p.col[keep], diagonal, np.full(n, anchor)))
    matrix = csc_array((data, (rows, columns)), shape=(n, n))
    try:
        solution = np.asarray(splu(matrix).solve(rewards))
    except RuntimeError:  # singular in floating point
        return None
    solution[anchor] = 0.0
    return solution if np.isfinite(solution).all() else None


def mec_quotient(
    matrix: SparseMatrix, gains: Gains, direction: Direction
) -> tuple[LinearProblem, Int32s, Int64s]:
    """The equations for the optimal expected gain of the end component in which a run stays.

    Each maximal end component is one state of the quotient with one more row, which stops and
    yields its gain. Every strategy stops almost surely, so the solution is unique.

    Args:
        matrix: the MDP.
        gains: bounds on the gains, which must not be negative.
        direction: maximise or minimise.

    Returns:
        The equations, the state of the quotient of each state, int32[n], and the row of the matrix
        of each row of the equations, -1 for one that stops.
    """
    parts = gains.parts
    state, count = parts.quotient_states()
    owner = graph.Incidence(matrix).owner_of_rows
    rows = np.flatnonzero(~parts.rows)
    kept = matrix.choose(rows).merge(state, count)
    whole = replace(kept, indptr=np.concatenate((kept.indptr, np.full(parts.count, kept.entries))))
    inside = parts.of >= 0
    stopping = np.empty(parts.count, np.int32)
    stopping[parts.of[inside]] = state[inside]
    of = np.concatenate((state[owner[rows]], stopping))
    order = np.argsort(of, kind="stable").astype(np.int64)
    groups = starts_of(np.bincount(of, minlength=count))
    none, one = full(len(rows), 0, exact=matrix.exact), full(parts.count, 1, exact=matrix.exact)
    low, high = (np.concatenate((none, g))[order] for g in (gains.lower, gains.upper))
    leave = np.concatenate((none, one))[order]
    origin = np.concatenate((rows, np.full(parts.count, -1)))[order]
    problem = LinearProblem(low, whole.choose(order, groups), high, leave, direction, False)
    return problem, state, origin
