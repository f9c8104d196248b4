"""Long-run average rewards of Markov decision processes, with certified bounds.

All states of an end component have the same best average (its gain), as each can be reached almost
surely from each. For *any* vector h,

    min over s of (T h - h)(s)  <=  best average  <=  max over s of (T h - h)(s),
    where T h = max over rows of (r + P h)

(Odoni 1969; Puterman 1994, chapters 8 and 9), so h may be any approximation: here, it comes from
value iteration on the aperiodic variant of the process, or from policy iteration where that is
slow. Under every strategy, a run stays in some end component from some time on, almost surely. So
the value of a state is the optimal expected gain of the end component that is reached (Chatterjee &
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
from symcheck.matrices.numbers import Numbers, full, rationals, sum_segments
from symcheck.matrices.rows import (
    Floats,
    Int32s,
    Int64s,
    SparseMatrix,
    best_of_rows,
    first_best,
    starts_of,
)
from symcheck.numerics import graph, rational_limits, tuning
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress
from symcheck.numerics.linear.rational import solve_chain
from symcheck.numerics.settings import Accuracy, Settings

__all__ = [
    "Gain",
    "Gains",
    "component_gains",
    "gain_policy",
    "larger_components",
    "mec_quotient",
    "ratio_gains",
    "top_policy",
]


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

    states, rows_of: its states and rows in the whole matrix. error: of probabilities, relative.
    """

    matrix: SparseMatrix
    rewards: Numbers = field(repr=False)
    states: Int32s = field(repr=False)
    rows_of: Int64s = field(repr=False)
    error: float = tuning.ENTRY_ERROR

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
        return best_of_rows(rows, self.groups, Direction.MAX)

    def rounding_errors(self, h: Numbers) -> Numbers:
        """A bound on the rounding error of r + P h - h in each row, relative to its own terms."""
        if self.matrix.is_rational:
            return full(self.matrix.rows, 0, rational=True)
        of_state = np.repeat(np.abs(h), np.diff(self.groups))
        terms = np.abs(self.rewards) + self.matrix.multiply(np.abs(h)) + of_state
        return np.asarray(((self.matrix.longest + 6) * 2.0**-52 + 2.0 * self.error) * terms)

    def rounding_error(self, h: Numbers) -> float:
        """A bound on the rounding error of T h - h; 0 in rational arithmetic."""
        if self.matrix.is_rational:
            return 0
        return float(
            ((self.matrix.longest + 6) * 2.0**-52 + 2.0 * self.error)
            * (np.abs(self.rewards).max() + 2.0 * np.abs(h).max())
        )


def component_gains(
    matrix: SparseMatrix,
    rewards: Numbers,
    direction: Direction,
    settings: Settings,
    observer: Observer | None = None,
    error: float = tuning.ENTRY_ERROR,
) -> Gains:
    """The optimal long-run average reward per step in each maximal end component.

    Args:
        matrix: the MDP.
        rewards: the reward of each row, float64[rows] or rationals.
        direction: maximise or minimise the average.
        settings: the accuracy.
        observer: receives the progress.
        error: of the probabilities, relative.

    Returns:
        Certified bounds, a quarter of epsilon apart unless rounding prevents it.
    """
    sign = -1 if direction is Direction.MIN else 1
    parts = graph.maximal_end_components(matrix, np.ones(matrix.states, np.bool_))
    lower, upper = (full(parts.count, 0, rational=matrix.is_rational) for _ in range(2))
    iterations = largest = 0
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    owner = graph.Incidence(matrix).owner_of_rows
    singleton = sizes == 1
    if singleton.any():
        # Components of one state: the best self-loop.
        best = full(parts.count, -np.inf, rational=matrix.is_rational)
        np.maximum.at(best, parts.of[owner[parts.rows]], sign * rewards[parts.rows])
        lower[singleton] = upper[singleton] = best[singleton]
    for c, part in larger_components(matrix, sign * rewards, parts, sizes, owner):
        gain = _gain(replace(part, error=error), settings, observer)
        lower[c], upper[c] = gain.lower, gain.upper
        iterations += gain.iterations
        largest = max(largest, part.matrix.states)
    if sign < 0:
        lower, upper = -upper, -lower
    return Gains(parts, lower, upper, iterations, largest)


def ratio_gains(
    matrix: SparseMatrix,
    rewards: Numbers,
    times: Numbers,
    direction: Direction,
    settings: Settings,
    observer: Observer | None = None,
    error: float = tuning.ENTRY_ERROR,
) -> Gains:
    """The optimal long-run average reward per unit of time in each maximal end component.

    It is the g for which the optimal average of `rewards - g * times` per step is 0. This average
    is a convex function of g (for a maximum), which falls as steeply as steps take time. Secants
    from below approach its zero, and meet it where they lie on the last of its linear pieces.

    Args:
        matrix: the MDP.
        rewards: what each row earns, float64[rows] or rationals.
        times: what it takes, alike. Each end component takes time.
        direction: maximise or minimise the average.
        settings: the accuracy.
        observer: receives the progress.
        error: of the probabilities and of times, relative.

    Returns:
        Certified bounds.

    Source: Dinkelbach (1967) for the function; Guck et al. (2014) for Markov automata.
    """
    sign = -1 if direction is Direction.MIN else 1
    rewards = sign * rewards
    shortest = component_gains(matrix, times, Direction.MIN, settings, observer, error)
    longest = component_gains(matrix, times, Direction.MAX, settings, observer, error)
    parts, iterations = shortest.parts, shortest.iterations + longest.iterations
    if not parts.count:
        return shortest
    exact = matrix.is_rational
    of = np.where(parts.rows, parts.of[graph.Incidence(matrix).owner_of_rows], 0)
    unit = 0 if exact else 8.0 * tuning.UNIT_ROUNDOFF + error

    def excess(g: Numbers, epsilon: float) -> Gains:
        gained = rewards - g[of] * times
        found = component_gains(
            matrix,
            np.where(parts.rows, gained, 0),
            Direction.MAX,
            Accuracy(epsilon=epsilon, relative=False, max_iterations=settings.max_iterations),
            observer,
            error,
        )
        margin = full(parts.count, 0, rational=exact)
        np.maximum.at(margin, of, np.where(parts.rows, abs(rewards) + abs(g[of] * times), 0))
        margin = unit * np.where(g == 0, 0, margin)
        return replace(found, lower=found.lower - margin, upper=found.upper + margin)

    least, most = shortest.lower, longest.upper
    if not exact:
        least, most = least * (1.0 - error), most * (1.0 + error)
    before = full(parts.count, 0, rational=exact)
    size = float(np.max(np.abs(rewards), initial=0))
    first = excess(before, 0.01 * settings.epsilon * size)
    g = np.where(first.lower >= 0, first.lower / most, first.lower / least)
    before, old = np.where(first.lower >= 0, before, 2 * g), first.lower
    if (first.lower < 0).any():
        old = np.where(first.lower >= 0, old, excess(before, 0.01 * settings.epsilon * size).lower)
    for _ in range(tuning.MEAN_PAYOFF_SECANTS):
        scale = np.abs(g)[g != 0] if settings.relative else np.ones(1)
        width = 0.1 * settings.epsilon * float((np.min(scale, initial=1e300)) * least.min())
        found = excess(g, 0.0 if exact else max(width, 1e-15 * size))
        iterations += found.iterations
        value = found.lower
        if (found.upper <= width).all() if not exact else not value.any():
            break
        slope = old - value
        moves = (slope > 0) & (value > 0)
        following = np.where(moves, g + value * (g - before) / np.where(moves, slope, 1), g)
        if (following == g).all():
            break
        before, old, g = np.where(moves, g, before), np.where(moves, value, old), following
    lower = g + np.minimum(found.lower, 0) / least
    upper = g + np.maximum(found.upper, 0) / least
    if sign < 0:
        lower, upper = -upper, -lower
    return Gains(parts, lower, upper, iterations, longest.largest)


def larger_components(
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
        matrix: the MDP.
        rewards: the reward of each row, float64[rows] or rationals.
        direction: maximise or minimise the average.
        gains: the result of `component_gains`.
        settings: the accuracy.

    Returns:
        A row for each state, -1 outside of end components.

    Raises:
        NumericalError: a component is too large for policy iteration.
    """
    sign = -1 if direction is Direction.MIN else 1
    signed = sign * rewards
    parts, owner = gains.parts, graph.Incidence(matrix).owner_of_rows
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    policy = np.full(matrix.states, -1, np.int64)
    inside = np.flatnonzero(parts.rows & (sizes[parts.of[owner]] == 1))
    order = inside[np.argsort(signed[inside], kind="stable")]
    policy[owner[order]] = order  # the greatest reward is the last
    for c, part in larger_components(matrix, signed, parts, sizes, owner):
        gain = sign * gains.lower[c], sign * gains.upper[c]
        policy[part.states] = part.rows_of[_best_policy(part, min(gain), max(gain), settings)]
    return policy


def _best_policy(part: _EndComponent, low: float, high: float, settings: Settings) -> Int64s:
    """A policy of an end component whose gain is within these bounds."""
    policy, n = top_policy(part), part.matrix.states
    if policy is not None:
        return policy
    finest = Accuracy(epsilon=0.0, relative=settings.relative)
    if not part.matrix.is_rational:
        if n > tuning.DIRECT_EVALUATION_STATES:
            raise NumericalError(f"an end component has {n:,} states, too many for a strategy")
        *_, policy = _policies(part, np.zeros(n), finest)
        if _attains(part, policy, low, high, settings):
            return policy
        if n > rational_limits.END_COMPONENT_STATES:
            raise NumericalError(
                f"rounding hides which choices are best in an end component of {n:,} states"
            )
        part = _in_rationals(part)
    *_, policy = _policies(part, full(n, 0, rational=True), finest)
    return policy


def top_policy(part: _EndComponent) -> Int64s | None:
    """A policy that earns the greatest reward at each step from some time on; None: none does."""
    everywhere = np.ones(part.matrix.states, np.bool_)
    greatest = part.rewards == part.rewards.max()
    cycles = graph.maximal_end_components(part.matrix, everywhere, greatest)
    if not cycles.count:
        return None
    goal = cycles.of >= 0
    _, policy = graph.prob1e_strategy(part.matrix, everywhere, goal)
    rows = np.flatnonzero(cycles.rows)
    policy[part.matrix.state_of_row[rows]] = rows
    return policy


def _attains(
    part: _EndComponent, policy: Int64s, low: float, high: float, settings: Settings
) -> bool:
    """Whether a policy earns a gain between these bounds wherever it may stay."""
    from symcheck.numerics.long_run.stationary import long_run_average

    chain, rewards = part.matrix.choose(policy), part.rewards[policy]
    scale = max(abs(low), abs(high)) if settings.relative else 1.0
    index = np.full(chain.states, -1, np.int32)
    for states in graph.bsccs(chain):
        index[states] = np.arange(len(states), dtype=np.int32)
        inner = chain.select(states, index, len(states))
        index[states] = -1
        if long_run_average(inner, rewards[states], settings).lower < low - (
            settings.epsilon * scale
        ):
            return False
    return True


def _in_rationals(part: _EndComponent) -> _EndComponent:
    """The component with the rationals that its doubles are; the rows are divided by their sums."""
    matrix = part.matrix
    entries = rationals(matrix.data.tolist())
    sums = sum_segments(entries, matrix.indptr)
    exact = replace(matrix, data=np.asarray(entries / np.repeat(sums, matrix.lengths)))
    return replace(part, matrix=exact, rewards=rationals(part.rewards.tolist()))


def _rational_gain(part: _EndComponent) -> tuple[float, float]:
    """Bounds on the gain from policy iteration in rational arithmetic.

    Probabilities and rewards are rounded, each by a few units in the last place. That changes a
    stationary probability relatively by at most 2n times as much, however small it is (O'Cinneide
    1993), and so the average of the absolute rewards under each policy.
    """
    n, nothing = part.matrix.states, full(part.matrix.states, 0, rational=True)
    exact, finest = _in_rationals(part), Accuracy(epsilon=0.0)
    low, high, *_ = _policies(exact, nothing, finest)
    if (part.rewards >= 0).all() or (part.rewards <= 0).all():
        size = max(abs(low), abs(high))
    else:
        size = _policies(replace(exact, rewards=np.abs(exact.rewards)), nothing, finest)[1]
    error = size * Fraction(8 * (n + part.matrix.longest)) * Fraction(tuning.UNIT_ROUNDOFF)
    error += size * 2 * n * Fraction(part.error)
    return (
        float(np.nextafter(float(low - error), -np.inf)),
        float(np.nextafter(float(high + error), np.inf)),
    )


def _gain(part: _EndComponent, settings: Settings, observer: Observer | None) -> Gain:
    """Bounds on the gain of an end component."""
    n = part.matrix.states
    if top_policy(part) is not None:
        top = part.rewards.max()
        return Gain(top, top)
    if part.matrix.is_rational:
        low, high, *_ = _policies(part, full(n, 0, rational=True), Accuracy(epsilon=0.0))
        if low < high:
            raise NumericalError("policy iteration for a long-run average did not end")
        return Gain(low, high)
    low, high, h, count = -np.inf, np.inf, np.zeros(n), 0
    for count in range(1, settings.max_iterations + 1):
        following = part.best(part.rows(h))
        low, high = _narrowed(h, following, part.rounding_error(h), low, high)
        if observer is not None:
            observer(Progress("value iteration", count, high - low, n))
        if _close_enough(low, high, part.rounding_error(h), settings):
            break
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
    if n <= rational_limits.END_COMPONENT_STATES and not _close_enough(low, high, 0.0, settings):
        try:
            found = _rational_gain(part)
        except OverflowError:  # beyond the doubles
            return Gain(low, high, count)
        low, high = max(low, found[0]), min(high, found[1])
    return Gain(low, high, count)


def _narrowed(
    h: Numbers, following: Numbers, errors: Numbers | float, low: float, high: float
) -> tuple[float, float]:
    """The bounds from T h - h, whose rounding error is at most `errors` (of each state, or all)."""
    change = following - h
    return max(low, (change - errors).min()), min(high, (change + errors).max())


def _close_enough(low: float, high: float, rounding_error: float, settings: Settings) -> bool:
    """Whether the bounds are as close as requested, or as close as rounding permits."""
    if isinstance(low, Fraction):
        return low == high
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
        errors = part.rounding_errors(h)
        low, high = _narrowed(h, best, part.best(errors), low, high)
        better = best > values[policy] + 4 * part.best(errors)
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
    solve = _rational_bias if chain.is_rational else _floating_bias
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
    reward, length = (solve_chain(cycle, v) for v in (rewards, full(n, 1, rational=True)))
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
    matrix: SparseMatrix,
    gains: Gains,
    direction: Direction,
    error: float = tuning.ENTRY_ERROR,
) -> tuple[LinearProblem, Int32s, Int64s]:
    """The equations for the optimal expected gain of the end component in which a run stays.

    Each maximal end component is one state of the quotient with one more row, which stops and
    yields its gain. Every strategy stops almost surely, so the solution is unique.

    Args:
        matrix: the MDP.
        gains: bounds on the gains, which must not be negative.
        direction: maximise or minimise.
        error: of the probabilities, relative.

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
    none, one = (
        full(len(rows), 0, rational=matrix.is_rational),
        full(parts.count, 1, rational=matrix.is_rational),
    )
    low, high = (np.concatenate((none, g))[order] for g in (gains.lower, gains.upper))
    leave = np.concatenate((none, one))[order]
    origin = np.concatenate((rows, np.full(parts.count, -1)))[order]
    problem = LinearProblem(
        low,
        whole.choose(order, groups),
        high,
        leave,
        direction,
        probability=False,
        error=error + matrix.longest * tuning.UNIT_ROUNDOFF,
    )
    return problem, state, origin
