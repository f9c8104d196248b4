"""Strategies of an MDP that attain the value of a property: a choice per state.

Step bounds and LTL formulas need memory: the state of an automaton of the formula. The strategy is
then one of the product, which reaches an accepting end component and visits its acceptance sets in
turn. Bounds on rewards, and rewards of the first steps, need counters (`bounded.py`).
Source: Baier & Katoen (2008), 10.6.4; de Alfaro (1997).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.path_formulas import (
    NextPath,
    RewardPath,
    StatePath,
    StatesOf,
    TemporalPath,
    UntilPath,
    negated,
    resolve,
    temporal,
)
from symcheck.check.queries.rewards import discount_of, reward_of
from symcheck.check.strategies.bounded import first_steps, within_rewards
from symcheck.check.strategies.builder import StrategyBuilder
from symcheck.direction import Direction
from symcheck.engines.base import StateSet
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import per_row
from symcheck.semantics.rewards import Reward, Time
from symcheck.semantics.time_bounds import Window, bound_value, window
from symcheck.syntax.ast import (
    BinaryTemporal,
    CostBoundedReward,
    CumulativeReward,
    DiscountedReward,
    Eventually,
    ExpectedTime,
    Expression,
    ExpressionNode,
    InstantaneousReward,
    PathFormula,
    ProbabilityOperator,
    RewardOperator,
    SteadyState,
    SteadyStateReward,
    TimeBound,
    TotalReward,
    UnaryTemporal,
)

__all__ = ["strategy_of", "temporal_strategy"]


def strategy_of(
    context: Context, formula: Expression, states_of: Callable[[Context], StatesOf]
) -> Strategy:
    """A strategy that attains the value of a P, R, T or S formula from every state.

    Strategies for X, F, U, G, W and R without bounds, for rewards until states are reached, total
    and discounted rewards, and for long-run averages have no memory; those for bounds on steps and
    rewards and for other LTL formulas have. The strategy of a bound (P>=p) is the one that decides
    it: the minimum for >=, the maximum for <=.

    Args:
        context: the model as rows, the log of the check that found the value, and its options,
            which ask for a strategy.
        formula: the formula.
        states_of: gives the states that satisfy a state formula.

    Raises:
        UnsupportedError: the model is no MDP, or the formula is of another kind.
    """
    if not context.engine.model.type.has_choices:
        kind = context.engine.model.type.name
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind}")
    if context.options.fairness:
        raise UnsupportedError("strategies are not supported with -fair")
    if not isinstance(formula, ProbabilityOperator | RewardOperator | ExpectedTime | SteadyState):
        raise UnsupportedError(
            "strategies are supported for P, R, T and S formulas, without conditions (||)"
        )
    optimum: str | None = formula.direction
    if optimum is None and formula.bound is not None:
        optimum = "min" if formula.bound.operator in (">", ">=") else "max"
    if optimum not in ("min", "max"):
        raise UnsupportedError("a strategy needs a minimum or a maximum: Pmin, Pmax, Rmin or Rmax")
    direction, sets = Direction(optimum), states_of(context)
    match formula:
        case ProbabilityOperator():
            return _probability(context, formula, sets, direction)
        case RewardOperator():
            return _reward(context, formula, sets, direction)
        case ExpectedTime(_, _, path):
            return _until_shown(context, Time(), path, sets, direction)
        case SteadyState(_, _, inner):
            builder = StrategyBuilder(context, direction)
            system = context.engine.system(context.engine.all)
            builder.average(per_row(system.groups, system.restrict(sets(inner))))
            return builder.strategy(direction)
        case _:
            assert_never(formula)


def _probability(
    context: Context, formula: ProbabilityOperator, states_of: StatesOf, direction: Direction
) -> Strategy:
    from symcheck.check.omega_regular.ltl import as_until

    path = resolve(formula.path, states_of, context.engine)
    if isinstance(path, TemporalPath):
        path = as_until(context, path) or path
    towards = direction
    if isinstance(path, NextPath | UntilPath | RewardPath) and path.negative:
        path, towards = negated(path), direction.dual
    builder = StrategyBuilder(context, towards)
    match path:
        case UntilPath(left, right, window) if window.trivial:
            builder.until(left, right)
        case NextPath(target, window) if window.trivial:
            builder.next(target)
        case RewardPath(UntilPath(left, right), counts):
            return within_rewards(context, left, right, counts, towards, direction)
        case RewardPath() | StatePath():
            raise UnsupportedError(
                "strategies are not supported for X with a bound on a reward and for state formulas"
            )
        case UntilPath() | NextPath() | TemporalPath():
            temporal_path = temporal(formula.path, states_of, context.engine.model)
            return temporal_strategy(context, temporal_path, direction)[0]
        case _:
            assert_never(path)
    return builder.strategy(direction)


def temporal_strategy(
    context: Context, path: TemporalPath, direction: Direction
) -> tuple[Strategy, StateSet]:
    """A strategy of the product with an automaton; a minimum is the maximum of the negation.

    Returns:
        The strategy, and the states of its product from which it is accepted almost surely because
        they belong to an accepting end component.
    """
    from symcheck.check.omega_regular.ltl import linear_product
    from symcheck.engines.explicit.product import ExplicitProduct

    product, pairs = linear_product(context, replace(path, negative=direction is Direction.MIN))
    assert isinstance(product, ExplicitProduct)
    inner = replace(context, engine=product.engine, relevant_states=None)
    builder = StrategyBuilder(inner, Direction.MAX)
    accepted = builder.accept(pairs)
    builder.until(product.engine.all, accepted)
    strategy = builder.strategy(direction)
    return replace(strategy, memory=product.pairs.automaton, entry=product.entry), accepted


def _reward(
    context: Context, formula: RewardOperator, states_of: StatesOf, direction: Direction
) -> Strategy:
    builder = StrategyBuilder(context, direction)
    reward = reward_of(context, formula)
    system = context.engine.system(context.engine.all)
    match formula.query:
        case CumulativeReward(bound):
            return first_steps(context, system.step_rewards(reward), _steps(bound), direction)
        case DiscountedReward(None, factor):
            builder.discounted(reward, discount_of(factor))
        case DiscountedReward(bound, factor):
            assert bound is not None
            rewards, discount = system.step_rewards(reward), discount_of(factor)
            return first_steps(context, rewards, _steps(bound), direction, discount)
        case InstantaneousReward(time):
            steps = Window(upper=bound_value(time)).steps().upper
            assert steps is not None
            last = system.state_rewards(reward)
            return first_steps(context, None, steps, direction, last=last)
        case CostBoundedReward():
            raise UnsupportedError("strategies are not supported for rewards within a cost")
        case TotalReward():
            builder.total(reward)
        case SteadyStateReward():
            builder.average(system.step_rewards(reward))
        case ExpressionNode() | UnaryTemporal() | BinaryTemporal() as path:
            return _until_shown(context, reward, path, states_of, direction)
        case _:
            assert_never(formula.query)
    return builder.strategy(direction)


def _steps(bound: TimeBound) -> int:
    steps = window(bound).steps().upper
    assert steps is not None
    return steps


def _until_shown(
    context: Context, reward: Reward, path: PathFormula, states_of: StatesOf, direction: Direction
) -> Strategy:
    """A strategy for the reward until a run shows that it satisfies a path formula."""
    target = resolve(path, states_of, context.engine) if isinstance(path, Eventually) else None
    if isinstance(target, UntilPath) and target.window.trivial:
        builder = StrategyBuilder(context, direction)
        builder.reward(reward, target.right)
        return builder.strategy(direction)
    from symcheck.check.omega_regular.ltl import co_safe_product
    from symcheck.engines.explicit.product import ExplicitProduct

    product, accepting = co_safe_product(context, temporal(path, states_of, context.engine.model))
    assert isinstance(product, ExplicitProduct)
    builder = StrategyBuilder(replace(context, engine=product.engine), direction)
    builder.reward(reward, accepting)
    strategy = builder.strategy(direction)
    return replace(strategy, memory=product.pairs.automaton, entry=product.entry)
