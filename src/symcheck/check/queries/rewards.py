"""Expected rewards: the reward structure of a formula, and the measure of its query."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measure_selection import long_run_measures, timed_measures
from symcheck.check.measures.reachability import reach_reward
from symcheck.check.measures.total_reward import total_reward
from symcheck.check.path_formulas import StatesOf, UntilPath, resolve, temporal
from symcheck.direction import Direction
from symcheck.engines.base import Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import is_infinite
from symcheck.semantics.expressions.evaluate import evaluate_constant
from symcheck.semantics.rewards import Reward, Time, operator_reward
from symcheck.semantics.time_bounds import bound_value, counts, window
from symcheck.syntax.ast import (
    BinaryTemporal,
    CostBoundedReward,
    CumulativeReward,
    DiscountedReward,
    Eventually,
    Expression,
    ExpressionNode,
    InstantaneousReward,
    PathFormula,
    RewardOperator,
    SteadyStateReward,
    TotalReward,
    UnaryTemporal,
)

__all__ = ["discount_of", "expected_time", "reward_of", "reward_values"]


def reward_of(context: Context, formula: RewardOperator) -> Reward:
    """The reward that an operator asks for."""
    return operator_reward(formula, context.engine.model)


def reward_values(
    context: Context,
    formula: RewardOperator,
    reward: Reward,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
    """The expected reward that a formula asks for, at each state.

    Raises:
        UnsupportedError: the query does not apply to the model, or its value is beyond doubles.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is found below
        values = _reward_values(context, formula, reward, states_of, direction)
    if isinstance(formula.query, _BOUNDED):
        _require_finite(context, values, reward)
    return values


def _require_finite(context: Context, values: Values, reward: Reward) -> None:
    """Refuse an overflow: what finite rewards give within a bound is finite.

    Raises:
        UnsupportedError: a value, or a sum that it is computed from, is beyond doubles.
    """
    engine = context.engine
    states = engine.all if context.relevant_states is None else context.relevant_states
    if engine.exact or not states:
        return
    low, high = values.maximum(states)[0], values.minimum(states)[1]
    if -math.inf < high and low < math.inf:
        return
    if not is_infinite(engine.system(engine.all).step_rewards(reward)).any():
        raise UnsupportedError(
            "the expected reward is beyond the range of floating-point numbers", hint="use -exact"
        )


_BOUNDED = CumulativeReward | DiscountedReward | InstantaneousReward


def _reward_values(
    context: Context,
    formula: RewardOperator,
    reward: Reward,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
    query = formula.query
    match query:
        case CumulativeReward(bound):
            time = window(bound)
            if time.upper is None or time.lower or time.lower_strict:
                raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
            return timed_measures(context).cumulative_reward(context, reward, time, direction)
        case CostBoundedReward(bound):
            from symcheck.check.measures.cost_bounded_reward import cost_bounded_reward

            costs = counts(bound, context.engine.model)
            if len(costs) > 1:
                raise UnsupportedError("a cumulative reward within one cost is supported, not more")
            return cost_bounded_reward(context, reward, costs[0], direction)
        case DiscountedReward(bound, factor):
            from symcheck.check.measures.discounted import discounted_reward

            steps = None if bound is None else window(bound).steps().upper
            return discounted_reward(context, reward, discount_of(factor), steps, direction)
        case TotalReward():
            # Fairness affects only the least value: staying where no reward is earned is unfair.
            if direction is Direction.MIN:
                _refuse_fairness(context)
            return total_reward(context, reward, direction)
        case InstantaneousReward(time_of):
            return timed_measures(context).instantaneous_reward(
                context, reward, bound_value(time_of), direction
            )
        case SteadyStateReward():
            return long_run_measures(context).steady_reward(context, reward, direction)
        case ExpressionNode() | UnaryTemporal() | BinaryTemporal():
            return _until_shown(context, reward, query, states_of, direction)
        case _:
            assert_never(query)


def discount_of(factor: Expression) -> Fraction:
    """The discount of a query, which binding has checked to be from 0 to less than 1."""
    return Fraction(evaluate_constant(factor))


def expected_time(
    context: Context, path: PathFormula, states_of: StatesOf, direction: Direction | None
) -> Values:
    """The expected time until a run shows that it satisfies a path formula, from each state."""
    return _until_shown(context, Time(), path, states_of, direction)


def _until_shown(
    context: Context,
    reward: Reward,
    path: PathFormula,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
    """The expected reward until a run shows that it satisfies a path formula."""
    _refuse_fairness(context)
    if isinstance(path, Eventually):
        target = resolve(path, states_of, context.engine)
        if isinstance(target, UntilPath) and target.window.trivial:
            return reach_reward(context, reward, target.right, direction)
    from symcheck.check.omega_regular.ltl import co_safe_reward

    return co_safe_reward(
        context, reward, temporal(path, states_of, context.engine.model), direction
    )


def _refuse_fairness(context: Context) -> None:
    if context.options.fairness:
        raise UnsupportedError(
            "expected rewards over fair strategies are not supported; probabilities are"
        )
