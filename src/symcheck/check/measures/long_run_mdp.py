"""Least and greatest long-run averages of Markov decision processes over all strategies.

See `symcheck.numerics.long_run.mean_payoff` for the method and its sources.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from symcheck.check.context import Context
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, is_infinite, is_rational
from symcheck.matrices.rows import Bools, Int32s, Int64s, per_row
from symcheck.numerics.linear.problem import Solution, largest_width
from symcheck.semantics.rewards import Reward
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.numerics.long_run.mean_payoff import Gains
    from symcheck.numerics.settings import Settings

__all__ = ["Averages", "solved_averages", "steady_probability", "steady_reward"]


def steady_probability(context: Context, states: StateSet, direction: Direction | None) -> Values:
    """Least or greatest long-run fraction of the steps or of the time that is spent in `states`,
    certified.
    """
    system = context.engine.system(context.engine.all)
    spent, times = per_row(system.groups, system.restrict(states)), _times(system)
    rewards = spent if times is None else spent * times
    return _average(context, system, rewards, direction, share=True)


def steady_reward(context: Context, reward: Reward, direction: Direction | None) -> Values:
    """Least or greatest long-run average of the reward per step or unit of time, certified."""
    system = context.engine.system(context.engine.all)
    rewards, error = system.step_rewards(reward), system.reward_error(reward)
    return _average(context, system, rewards, direction, share=False, error=error)


def _times(system: System) -> Numbers | None:
    """The mean time that each row takes; None in discrete time."""
    rates = system.exit_rates
    return None if rates is None else np.where(rates > 0, 1 / np.where(rates > 0, rates, 1), 0)


@dataclass(frozen=True, eq=False)
class Averages:
    """The solved equations of long-run averages.

    Attributes:
        gains: the best average of each end component.
        shift: what was added to the gains.
        state: the unknown of each state, int32[states].
        solution: of the shifted averages, over the unknowns.
        origin: the row of the model of each row of the equations; -1: a run stays.
    """

    gains: Gains
    shift: float
    state: Int32s
    solution: Solution
    origin: Int64s


def solved_averages(
    context: Context, system: System, rewards: Numbers, direction: Direction
) -> Averages:
    """Solve the equations of long-run averages of an MDP.

    Args:
        context: the engine, the options and the log.
        system: the equations over all states.
        rewards: the reward of each row.
        direction: minimise or maximise over strategies.

    Raises:
        UnsupportedError: a reward is infinite, or only fair strategies count.
    """
    key = "average", direction, context.options.epsilon
    return context.once(key, lambda: _solved_averages(context, system, rewards, direction))


def _solved_averages(
    context: Context, system: System, rewards: Numbers, direction: Direction
) -> Averages:
    from symcheck.check.measures.markov_automata import refuse_zeno
    from symcheck.numerics.linear.methods import solve_linear
    from symcheck.numerics.long_run.mean_payoff import component_gains, mec_quotient
    from symcheck.numerics.long_run.timed_gains import timed_gains

    if is_infinite(rewards).any():
        raise UnsupportedError("long-run averages of infinite rewards are not supported")
    options, observer = context.options, context.observer
    # With rewards of both signs, averages near 0 result from cancellation: use a smaller epsilon.
    finer = (
        replace(options, epsilon=1e-4 * options.epsilon)
        if rewards.min(initial=0.0) < 0
        else options
    )
    rates = system.exit_rates
    if rates is None:
        gains = component_gains(system.matrix, rewards, direction, finer, observer, system.error)
    else:
        refuse_zeno(context, system, "long-run averages")
        gains = timed_gains(system.matrix, rewards, rates, direction, finer, observer, system.error)
    # Averages that may be negative are shifted up: every strategy stays in some end component with
    # probability 1, so the values are shifted by the same amount. Rational equations may have
    # negative constants.
    negative = not context.engine.is_rational and gains.lower.min() < 0
    shift = 2 * np.abs(gains.lower).max() if negative else 0
    shifted = replace(gains, lower=gains.lower + shift, upper=gains.upper + shift)
    if (same := _same_everywhere(shifted, finer)) is not None:
        return Averages(gains, shift, np.zeros(system.n, np.int32), same, np.empty(0, np.int64))
    problem, state, origin = mec_quotient(system.matrix, shifted, direction, system.error)
    gain_error = float(
        ((shifted.upper - shifted.lower) / np.maximum(shifted.upper, 1e-300)).max(initial=0.0)
    )
    accuracy = replace(finer, epsilon=min(max(finer.epsilon, 4.0 * gain_error), 0.5))
    solution = solve_linear(problem, accuracy, observer)
    return Averages(gains, shift, state, solution, origin)


def _same_everywhere(gains: Gains, settings: Settings) -> Solution | None:
    """One value for all states if gains are close, or there is one: each run stays somewhere."""
    lower, upper = gains.lower.min(keepdims=True), gains.upper.max(keepdims=True)
    same = bool(lower[0] == upper[0])
    close = not is_rational(lower) and (
        largest_width(lower, upper, settings.relative) <= settings.epsilon
    )
    if not (same or close or gains.parts.count == 1):
        return None
    return Solution(lower, upper, "gains", same, explanation="the same average everywhere")


def _average(
    context: Context,
    system: System,
    rewards: Numbers,
    direction: Direction | None,
    *,
    share: bool,
    error: float = 0.0,
) -> Values:
    """The averages; error: of the rewards, relative."""
    assert direction is not None
    averages = solved_averages(context, system, rewards, direction)
    gains, shift, state = averages.gains, averages.shift, averages.state
    solution = averages.solution
    lower, upper = solution.lower[state], solution.upper[state]
    exact = (
        solution.up_to_rounding and shift == 0 and bool(np.array_equal(gains.lower, gains.upper))
    )
    if not context.engine.is_rational:
        # The shift is rounded, and so are rewards, relative to the largest if some are negative.
        rounding_error = 2.0**-51 * upper if shift else 0.0
        lower, upper = lower - rounding_error - shift, upper + rounding_error - shift
        signed = rewards.min(initial=0.0) < 0
        size = _largest_average(system, rewards, context) if signed else None
        lower = lower - error * (np.abs(lower) if size is None else size)
        upper = upper + error * (np.abs(upper) if size is None else size)
    if share:
        lower, upper = np.clip(lower, 0, 1), np.clip(upper, 0, 1)
    count = gains.parts.count
    explanation = (
        f"{count} end component{'s' * (count != 1)}, "
        f"the largest of {counted(max(1, gains.largest), 'state')}; {solution.explanation}"
    )
    run = SolverRun(
        "steady",
        "mean payoff",
        system.n,
        gains.iterations + solution.iterations,
        explanation,
        solution.certified,
    )
    context.log.runs.append(run)
    context.warn_if_wide(largest_width(lower, upper, context.options.relative), explanation)
    if context.engine.is_rational:
        values = system.lift(lower, None)
    else:
        values = system.lift(lower, upper, up_to_rounding=exact)
    return _with_qualitative(context, gains, values, direction) if share else values


def _largest_average(system: System, rewards: Numbers, context: Context) -> float:
    """An upper bound on all averages of the absolute rewards."""
    from symcheck.numerics.long_run.timed_gains import timed_gains

    if (rates := system.exit_rates) is None:
        return float(np.abs(rewards).max(initial=0.0))
    found = timed_gains(
        system.matrix, np.abs(rewards), rates, Direction.MAX, context.options, error=system.error
    )
    return float(found.upper.max(initial=0.0))


def _with_qualitative(
    context: Context, gains: Gains, values: Values, direction: Direction
) -> Values:
    """The values, with exactly 0 and 1 where graph analysis decides them.

    The best value is taken where its end components are reached almost surely, the worst one where
    no other end component can be reached.
    """
    graph = context.engine.graph
    sure = {v: (gains.lower == v) & (gains.upper == v) for v in (0.0, 1.0)}
    best, worst = (1.0, 0.0) if direction is Direction.MAX else (0.0, 1.0)
    decided = {
        best: graph.prob1(context.engine.all, _members(context, gains, sure[best]), Direction.MAX),
        worst: ~graph.exists_until(context.engine.all, _members(context, gains, ~sure[worst])),
    }
    return values.choose(~(decided[0.0] | decided[1.0]), context.engine.indicator(decided[1.0]))


def _members(context: Context, gains: Gains, chosen: Bools) -> StateSet:
    """The states of the chosen end components."""
    inside = gains.parts.of >= 0
    members = np.zeros(len(inside), np.bool_)
    members[inside] = chosen[gains.parts.of[inside]]
    return context.engine.from_bools(members)
