"""Long-run averages of Markov automata per unit of time, with certified bounds.

The states that take time jump in a Poisson process, and choices take no time. For any vector h of
values in these states, the best average of an end component is between the least and the greatest
change of h in a jump, times the rate of the process (as for decision processes, see
`mean_payoff`). Value iteration supplies h; where it is slow, the zero of an average per step is
found instead (`ratio_gains`).

Source: Butkova, Wimmer & Hermanns, 'Long-run rewards for Markov automata' (TACAS 2017).
"""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.long_run.mean_payoff import (
    Gains,
    larger_components,
    ratio_gains,
    top_policy,
)
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.timed_choices import TimedProblem, TimedSteps
from symcheck.numerics.tuning import UNIT_ROUNDOFF

__all__ = ["timed_gains"]


def timed_gains(
    matrix: SparseMatrix,
    rewards: Numbers,
    exit_rates: Numbers,
    direction: Direction,
    settings: Settings,
    observer: Observer | None = None,
    error: float = tuning.ENTRY_ERROR,
) -> Gains:
    """The optimal long-run average reward per unit of time in each maximal end component.

    Args:
        matrix: the probabilities.
        rewards: what each row earns, float64[rows] or rationals.
        exit_rates: 0 where a row takes no time. Each end component takes time.
        direction: maximise or minimise the average.
        settings: the accuracy.
        observer: receives the progress.
        error: of the probabilities and rates, relative.
    """
    timed = exit_rates > 0
    times = np.where(timed, 1 / np.where(timed, exit_rates, 1), 0)
    if matrix.is_rational:
        return ratio_gains(matrix, rewards, times, direction, settings, observer, error)
    sign = -1.0 if direction is Direction.MIN else 1.0
    signed: Floats = sign * rewards
    parts = graph.maximal_end_components(matrix, np.ones(matrix.states, np.bool_))
    owner = graph.Incidence(matrix).owner_of_rows
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    lower, upper = np.full(parts.count, -np.inf), np.full(parts.count, -np.inf)
    single = np.flatnonzero(parts.rows & (sizes[parts.of[owner]] == 1))
    average = signed[single] / times[single]
    known = (average == signed[single]) & (error <= 2.0 * UNIT_ROUNDOFF)
    size = np.where(known, 0.0, 4.0 * UNIT_ROUNDOFF + error) * np.abs(average)
    np.maximum.at(lower, parts.of[owner[single]], average - size)
    np.maximum.at(upper, parts.of[owner[single]], average + size)
    jumps, largest = 0, 1
    for c, part in larger_components(matrix, signed, parts, sizes, owner):
        n, rates = part.matrix.states, exit_rates[part.rows_of]
        if part.rewards.max() == 0.0 and top_policy(part) is not None:
            lower[c] = upper[c] = 0.0
            continue
        nothing = np.zeros(n)
        problem = TimedProblem(
            part.matrix,
            rates,
            part.rewards,
            np.zeros(part.matrix.rows),
            nothing,
            nothing,
            Direction.MAX,
            0.0,
            np.inf,
            error,
        )
        found = _bounds(problem, settings, observer)
        if found is None:
            return ratio_gains(matrix, rewards, times, direction, settings, observer, error)
        lower[c], upper[c], made = found
        jumps += made
        largest = max(largest, n)
    if sign < 0:
        lower, upper = -upper, -lower
    return Gains(parts, lower, upper, jumps, largest)


def _bounds(
    problem: TimedProblem, settings: Settings, observer: Observer | None
) -> tuple[float, float, int] | None:
    """Bounds on the greatest average of an end component, and the jumps that were made; None: they
    do not come close in time.
    """
    rate = tuning.GAIN_RATE * float(problem.exit_rates.max())
    steps = TimedSteps(problem, rate)
    if steps.has_cycles:
        return None
    timed = ~problem.instants
    h = np.zeros(problem.matrix.states)
    low, high, jumps = -np.inf, np.inf, 0
    for count in tuning.GAIN_JUMPS:
        h = steps.jumped(h, count)
        h -= h[timed][0]
        change = (steps.jumped(h, 1) - h)[timed]
        jumps += count + 1
        scale = float(np.abs(h).max()) + (steps.depth + 1) * float(np.abs(problem.constant).max())
        of_row = (2 * problem.matrix.longest + 12) * UNIT_ROUNDOFF + 4.0 * problem.error
        error = (steps.depth + 1) * of_row * scale
        low = max(low, rate * (float(change.min()) - error))
        high = min(high, rate * (float(change.max()) + error))
        if observer is not None:
            observer(Progress("value iteration", jumps, high - low, problem.matrix.states))
        goal = 0.25 * settings.epsilon * (max(abs(low), abs(high)) if settings.relative else 1.0)
        if high - low <= max(goal, 4.0 * rate * error):
            return low, high, jumps
    return None
