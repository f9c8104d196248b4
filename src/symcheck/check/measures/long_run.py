"""Long-run averages of Markov chains: averages of bottom components and reachability of these.

Source: Baier & Katoen (2008), 10.1.2; Baier, Haverkort, Hermanns & Katoen (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import boundary_values
from symcheck.check.measures.signed_steps import REWARD_ERROR
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, Number, StateSet, System, Values
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.tuning import CANCELLATION
from symcheck.semantics.expressions.literals import LARGEST_WHOLE
from symcheck.semantics.rewards import Reward

__all__ = ["steady_probability", "steady_reward"]

RewardOf = Callable[[System], tuple[Numbers, bool]]
"""Rewards of a system's states, and whether they are sums that were rounded."""


def steady_probability(
    context: Context, states: StateSet, direction: Direction | None = None
) -> Values:
    """Long-run fraction of the time that is spent in `states`, from each state.

    All states of a bottom component have the same average; any other state has the mean of these
    averages, weighted with the probabilities of reaching the components.
    """
    return _average(context, lambda system: (system.restrict(states), False))


def steady_reward(context: Context, reward: Reward, direction: Direction | None = None) -> Values:
    """Long-run average of the reward per step (DTMC) or unit of time (CTMC)."""
    timed = context.engine.model.type.continuous_time  # rewards of transitions times rates

    def reward_of(system: System) -> tuple[Numbers, bool]:
        return system.earned(reward), timed and bool(np.any(system.rewards(reward)[1]))

    return _average(context, reward_of)


def _average(context: Context, reward_of: RewardOf) -> Values:
    engine = context.engine
    recurrent, low, high = (
        engine.none,
        *(full(engine.states, 0, rational=engine.is_rational) for _ in range(2)),
    )
    summed = False
    for states, members, lower, upper, of_sums in _components(context, reward_of):
        recurrent = recurrent | states
        summed = summed or of_sums
        low[members], high[members] = lower, upper
    system = engine.system(recurrent)
    inside = engine.to_bools(recurrent)
    point = np.array_equal(low, high)
    # An average that is no whole number is a sum or quotient in floating point, and a large one may
    # be rounded too.
    rounded = (low == high) & (not engine.is_rational)
    if rounded.any():
        rounded &= summed | (low % 1 > 0) | (np.abs(low) >= LARGEST_WHOLE)
    if not point:
        margin = np.where(rounded, ROUNDING * np.abs(low), 0)
        low, high = low - margin, high + margin
    exact = point and bool(np.any(rounded))
    averages = system.lift(low[inside], None if point else high[inside], up_to_rounding=exact)
    return boundary_values(context, ~recurrent, averages)


def _components(
    context: Context, reward_of: RewardOf
) -> Iterator[tuple[StateSet, Bools, Numbers, Numbers, bool]]:
    """Sets of recurrent states, with bounds on the average at each member; whether it was rounded.

    All absorbing states form one set; every larger bottom component is a set.
    """
    engine = context.engine
    if engine.has_rows:
        # There may be many absorbing states: they form one set, with their rewards as averages.
        parts = graph.bsccs(engine.system(engine.all).weights)
        members = np.zeros(engine.states, bool)
        members[[int(p[0]) for p in parts if len(p) == 1]] = True
        if members.any():  # the engine keeps its last system: that of all states, if none absorbs
            absorbing = engine.from_bools(members)
            rewards, rounded = reward_of(engine.system(absorbing))
            yield absorbing, members, rewards, rewards, rounded
        larger = [_indices(p, engine.states) for p in parts if len(p) > 1]
        sets = (engine.from_bools(m) for m in larger)
    else:
        sets = (s for s in engine.graph.bsccs())
    for states in sets:
        system = engine.system(states)
        rewards, rounded = reward_of(system)
        lower, upper = _component_average(context, system, rewards)
        yield states, engine.to_bools(states), system.full(lower), system.full(upper), rounded


def _indices(states: np.ndarray[tuple[int, ...], np.dtype[np.int32]], n: int) -> Bools:
    members = np.zeros(n, bool)
    members[states] = True
    return members


def _component_average(context: Context, system: System, reward: Numbers) -> tuple[Number, Number]:
    """Bounds on the average of a bottom component, whose reward itself if it is constant."""
    from symcheck.numerics.long_run.stationary import long_run_average

    if (reward == reward[0]).all():
        return reward[0], reward[0]
    average = long_run_average(system.weights, reward, context.options, context.observer)
    context.log.runs.append(
        SolverRun(
            "steady",
            "long-run average",
            system.n,
            average.iterations,
            average.explanation,
        )
    )
    low, high = average.lower, average.upper
    relative = context.options.relative
    signed = not context.engine.is_rational and bool(reward.min() < 0)
    if signed:
        size = long_run_average(system.weights, np.abs(reward), context.options).upper
        if size > CANCELLATION * abs(low):
            low, high = low - REWARD_ERROR * size, high + REWARD_ERROR * size
    bounds = np.array([low]), np.array([high])
    width = largest_width(*bounds, relative and not signed)
    if width and relative and signed:  # the average may be 0, relative to which no bounds are close
        width /= float(np.abs(reward).max())
    context.warn_if_wide(width, average.explanation)
    return low, high
