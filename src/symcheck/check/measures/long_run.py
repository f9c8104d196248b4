"""Long-run averages of Markov chains: averages of bottom components and reachability of these.

Source: Baier & Katoen (2008), 10.1.2 and 10.5.2; Baier, Haverkort, Hermanns & Katoen (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import frexp

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import boundary_values
from symcheck.check.measures.signed_steps import REWARD_ERROR
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import Number, StateSet, System, Values
from symcheck.matrices.numbers import Numbers, full, is_rational
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import largest_width
from symcheck.semantics.rewards import Reward
from symcheck.syntax.operators import Operator

__all__ = ["steady_probability", "steady_reward"]

_TINY = 1e-100
"""Averages below are scaled."""
_LARGEST_POWER = 1022
"""2 to the power of its opposite has all its digits."""

RewardOf = Callable[[System], tuple[Numbers, float]]
"""Rewards of a system's states, and their relative error."""


def steady_probability(
    context: Context, states: StateSet, direction: Direction | None = None
) -> Values:
    """Long-run fraction of the time that is spent in `states`, from each state.

    All states of a bottom component have the same average; any other state has the mean of these
    averages, weighted with the probabilities of reaching the components.
    """
    return _average(context, lambda system: (system.restrict(states), 0.0))


def steady_reward(context: Context, reward: Reward, direction: Direction | None = None) -> Values:
    """Long-run average of the reward per step (DTMC) or unit of time (CTMC)."""
    return _average(context, lambda system: (system.earned(reward), system.earned_error(reward)))


def _average(context: Context, reward_of: RewardOf) -> Values:
    engine = context.engine
    recurrent, low, high = (
        engine.none,
        *(full(engine.states, 0, rational=engine.is_rational) for _ in range(2)),
    )
    exact = True
    for states, members, lower, upper, rounded in _components(context, reward_of):
        recurrent = recurrent | states
        exact = exact and rounded
        low[members], high[members] = lower, upper
    inside = engine.to_bools(recurrent)
    low, high, power = _scaled(low[inside], high[inside])
    point = np.array_equal(low, high)
    exact = exact and not point
    system = engine.system(recurrent)
    averages = system.lift(low, None if point else high, up_to_rounding=exact)
    values = boundary_values(context, ~recurrent, averages)
    return values.map(Operator.TIMES, 2.0**-power) if power else values


def _scaled(low: Numbers, high: Numbers) -> tuple[Numbers, Numbers, int]:
    """Bounds of tiny averages times a power of two, so that products with probabilities do not
    underflow; and its exponent.
    """
    largest = 1.0 if is_rational(low) else float(max(-low.min(), high.max()))
    if not 0.0 < largest < _TINY:
        return low, high, 0
    power = min(-frexp(largest)[1], _LARGEST_POWER)
    return np.ldexp(low, power), np.ldexp(high, power), power


def _components(
    context: Context, reward_of: RewardOf
) -> Iterator[tuple[StateSet, Bools, Numbers, Numbers, bool]]:
    """Sets of recurrent states, with bounds on the average at each member; whether these differ by
    rounding alone.

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
            yield absorbing, members, *_rounded(engine.system(absorbing), reward_of), True
        larger = [_indices(p, engine.states) for p in parts if len(p) > 1]
        sets = (engine.from_bools(m) for m in larger)
    else:
        sets = (s for s in engine.graph.bsccs())
    for states in sets:
        system = engine.system(states)
        lower, upper, rounded = _component_average(context, system, *reward_of(system))
        yield states, engine.to_bools(states), system.full(lower), system.full(upper), rounded


def _rounded(system: System, reward_of: RewardOf) -> tuple[Numbers, Numbers]:
    """Bounds on the rewards of absorbing states; whole numbers that are small are not rounded."""
    rewards, error = reward_of(system)
    if is_rational(rewards):
        return rewards, rewards
    margin = error * np.abs(rewards)
    return rewards - margin, rewards + margin


def _indices(states: np.ndarray[tuple[int, ...], np.dtype[np.int32]], n: int) -> Bools:
    members = np.zeros(n, bool)
    members[states] = True
    return members


def _component_average(
    context: Context, system: System, reward: Numbers, error: float
) -> tuple[Number, Number, bool]:
    """Bounds on the average of a bottom component, whose reward itself if it is constant, and
    whether they differ by rounding alone.

    error: of the reward, relative.
    """
    from symcheck.numerics.long_run.stationary import long_run_average

    if (reward == reward[0]).all():
        margin = 0 if is_rational(reward) else error * abs(reward[0])
        return reward[0] - margin, reward[0] + margin, True
    average = long_run_average(
        system.weights, reward, context.options, context.observer, system.entry_error
    )
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
    if is_rational(reward):
        return low, high, True
    relative, signed = context.options.relative, bool(reward.min() < 0)
    size = max(abs(low), abs(high))
    if signed and error:
        size = long_run_average(
            system.weights, np.abs(reward), context.options, error=system.entry_error
        ).upper
        error = max(error, REWARD_ERROR)
    low, high = low - error * size, high + error * size
    bounds = np.array([low]), np.array([high])
    width = largest_width(*bounds, relative and not signed)
    if width and relative and signed:  # the average may be 0, relative to which no bounds are close
        width /= float(np.abs(reward).max())
    context.warn_if_wide(width, average.explanation)
    return low, high, average.iterations == 1
