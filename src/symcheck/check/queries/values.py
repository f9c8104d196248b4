"""The values of a query at each state: the measure that computes each quantity."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measure_selection import long_run_measures, timed_measures
from symcheck.check.measures.reachability import reach_reward
from symcheck.check.queries.path_probabilities import probability
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.engines.capabilities import HasUncertainty
from symcheck.errors import NeedsRationalsError, UnsupportedError
from symcheck.matrices.numbers import Numbers, is_infinite
from symcheck.semantics.path_formulas import NextPath, UntilPath
from symcheck.semantics.query import (
    CoSafeReward,
    CostBoundedReward,
    CumulativeReward,
    DiscountedReward,
    EndedReward,
    ExpectedReward,
    InstantaneousReward,
    LongRunProbability,
    LongRunReward,
    PathProbability,
    ProbabilityGiven,
    Quantity,
    Query,
    ReachReward,
    TotalReward,
)

__all__ = ["against_nature", "values"]


def values(
    context: Context,
    query: Query[StateSet],
    exactly: Callable[[StateSet], Numbers] | None = None,
) -> Values:
    """The value of a query at each state, with the accuracy of the context.

    Args:
        context: the engine, the options and the log.
        query: what is asked for, over the sets of the engine.
        exactly: gives the rationals at some states, where doubles have too few digits; may raise
            SymcheckError. None: nothing does.

    Raises:
        UnsupportedError: the quantity does not apply to the model, or a value is beyond doubles.
    """
    try:
        return _values(context, query, exactly)
    except NeedsRationalsError as error:
        if _is_irrational(context, query.quantity):
            raise UnsupportedError(error.message, note=error.note) from None
        raise


def _is_irrational(context: Context, quantity: Quantity[StateSet]) -> bool:
    """Whether a quantity is bounded in continuous time, so that -exact refuses it."""
    match quantity:
        case PathProbability(UntilPath(window=window) | NextPath(window=window)):
            bounded = not window.is_unbounded
        case _:
            bounded = isinstance(quantity, CumulativeReward | InstantaneousReward)
    return bounded and context.engine.model.type.continuous_time


def _values(
    context: Context, query: Query[StateSet], exactly: Callable[[StateSet], Numbers] | None
) -> Values:
    context, query = against_nature(context, query)
    quantity = query.quantity
    if (game := context.concurrent_game(query)) is not None:
        from symcheck.check.measures.concurrent import concurrent_values

        return concurrent_values(context, game, quantity)
    context, direction = context.playing(query)
    match quantity:
        case PathProbability(path):
            return probability(context, path, direction)
        case ProbabilityGiven():
            from symcheck.check.queries.conditional import conditional_probability

            return conditional_probability(context, quantity, direction, exactly)
        case LongRunProbability(states):
            if not states:
                return context.engine.constant(0)
            if states == context.engine.all:
                return context.engine.constant(1)
            return long_run_measures(context).steady_probability(context, states, direction)
        case _:
            with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is found below
                found = _expected(context, quantity, direction)
            if isinstance(quantity, CumulativeReward | DiscountedReward | InstantaneousReward):
                _require_finite(context, found, quantity)
            return found


def against_nature(context: Context, query: Query[StateSet]) -> tuple[Context, Query[StateSet]]:
    """The context and the query in which nature's direction follows from that of strategies."""
    uncertain = context.engine.capability(HasUncertainty)
    if uncertain is None or query.nature is None:
        return context, query
    engine, direction = uncertain.against(query.direction, query.nature)
    return replace(context, engine=engine), replace(query, direction=direction)


def _expected(
    context: Context, quantity: ExpectedReward[StateSet], direction: Direction | None
) -> Values:
    match quantity:
        case ReachReward(reward, target):
            return reach_reward(context, reward, target, direction)
        case CoSafeReward(reward, path):
            from symcheck.check.omega_regular.ltl import co_safe_reward

            return co_safe_reward(context, reward, path, direction)
        case TotalReward(reward) if context.engine.has_opponents:
            from symcheck.check.measures.ended_reward import kept_reward

            return kept_reward(context, reward, context.engine.none, direction)
        case TotalReward(reward):
            from symcheck.check.measures.total_reward import total_reward

            return total_reward(context, reward, direction)
        case CumulativeReward(reward, window):
            return timed_measures(context).cumulative_reward(context, reward, window, direction)
        case CostBoundedReward(reward, cost):
            from symcheck.check.measures.cost_bounded_reward import cost_bounded_reward

            return cost_bounded_reward(context, reward, cost, direction)
        case DiscountedReward(reward, discount, steps):
            from symcheck.check.measures.discounted import discounted_reward

            return discounted_reward(context, reward, discount, steps, direction)
        case EndedReward(reward, target, kept):
            from symcheck.check.measures.ended_reward import kept_reward, lost_reward

            return (kept_reward if kept else lost_reward)(context, reward, target, direction)
        case InstantaneousReward(reward, time):
            return timed_measures(context).instantaneous_reward(context, reward, time, direction)
        case LongRunReward(reward):
            return long_run_measures(context).steady_reward(context, reward, direction)
        case _:
            assert_never(quantity)


def _require_finite(
    context: Context,
    values: Values,
    quantity: CumulativeReward | DiscountedReward | InstantaneousReward,
) -> None:
    """Refuse an overflow: what finite rewards give within a bound is finite.

    Raises:
        UnsupportedError: a value, or a sum that it is computed from, is beyond doubles.
    """
    engine = context.engine
    states = engine.all if context.relevant_states is None else context.relevant_states
    if engine.is_rational or not states:
        return
    low, high = values.maximum(states)[0], values.minimum(states)[1]
    if -math.inf < high and low < math.inf:
        return
    if not is_infinite(engine.system(engine.all).step_rewards(quantity.reward)).any():
        raise NeedsRationalsError(
            "the expected reward is beyond the range of floating-point numbers"
        )
