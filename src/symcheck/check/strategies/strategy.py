"""Strategies of an MDP that attain the value of a property: a choice per state.

Step bounds and LTL formulas need memory: the state of an automaton of the formula. The strategy is
then one of the product, which reaches an accepting end component and visits its acceptance sets in
turn. Bounds on rewards, and rewards of the first steps, need counters (`bounded.py`).
Source: Baier & Katoen (2008), 10.6.4; de Alfaro (1997).
"""

from __future__ import annotations

from dataclasses import replace
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.queries.values import against_nature
from symcheck.check.state_formulas import query_of
from symcheck.check.strategies.bounded import first_steps, within_rewards
from symcheck.check.strategies.builder import StrategyBuilder
from symcheck.direction import Direction
from symcheck.engines.base import StateSet
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import per_row
from symcheck.semantics.features import Feature, class_name, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
    as_ltl,
    negated,
)
from symcheck.semantics.query import (
    CoSafeReward,
    CumulativeReward,
    DiscountedReward,
    EndedReward,
    InstantaneousReward,
    LongRunProbability,
    LongRunReward,
    PathProbability,
    Query,
    ReachReward,
    TotalReward,
)
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import AnyMeasure, Expression, MultiObjective, Weights, letters_of

__all__ = ["has_strategy", "strategy_attaining", "strategy_of", "temporal_strategy"]

_WITHOUT_TIME = (
    Feature.REACHABILITY,
    Feature.LTL,
    Feature.REACH_REWARDS,
    Feature.TOTAL_REWARDS,
)
"""What strategies attain without looking at the time."""


def has_strategy(model: BoundModel, formula: Expression) -> bool:
    """Whether a strategy attains the value of a formula, if its quantity is a supported one."""
    return _has_choices(model) and isinstance(formula, AnyMeasure | MultiObjective)


def _has_choices(model: BoundModel) -> bool:
    return model.type.has_choices or model.weights is Weights.INTERVALS


def strategy_of(context: Context, formula: Expression) -> Strategy:
    """A strategy that attains the value of a measure from every state.

    Strategies for X, F, U, G, W and R without bounds, for rewards until states are reached, total
    and discounted rewards, and for long-run averages have no memory; those for bounds on steps and
    rewards and for other LTL formulas have. The strategy of a bound (P>=p) is the one that decides
    it: the minimum for >=, the maximum for <=.

    Args:
        context: the model as rows, the log of the check that found the value, and its options,
            which ask for a strategy.
        formula: the formula.

    Raises:
        UnsupportedError: the model is no MDP, or the formula is of another kind.
    """
    kind = context.engine.model.type
    require(context.engine.model, Feature.STRATEGIES)
    if not _has_choices(context.engine.model):
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind.name}")
    if context.options.fairness:
        raise UnsupportedError("strategies are not supported with -fair")
    if not isinstance(formula, AnyMeasure):
        raise UnsupportedError(f"strategies are supported for {letters_of(AnyMeasure)} formulas")
    if kind.partially_observed:
        from symcheck.check.strategies.beliefs import belief_strategy

        return belief_strategy(context)
    return strategy_attaining(context, query_of(context, formula))


def strategy_attaining(context: Context, query: Query[StateSet]) -> Strategy:
    """A strategy that attains the value of a query from every state of an explicit engine.

    Raises:
        UnsupportedError: the query is of another kind.
    """
    context, query = against_nature(context, query)
    quantity = query.quantity
    context, direction = context.playing(query)
    assert direction is not None
    model = context.engine.model
    if model.type.continuous_time and quantity.feature not in _WITHOUT_TIME:
        raise UnsupportedError(
            f"strategies for {quantity.feature.value} are not available for {model.type.called}"
        )
    if model.weights is Weights.INTERVALS:
        match quantity:
            case PathProbability(NextPath()) | CumulativeReward() | InstantaneousReward():
                raise UnsupportedError(
                    f"strategies for X, C<=k and I=k are not available for {class_name(model)}"
                )
            case _:
                pass
    builder = StrategyBuilder(context, direction)
    system = context.engine.system(context.engine.all)
    match quantity:
        case PathProbability(path):
            return _of_path(context, path, direction)
        case LongRunProbability(states):
            builder.average(per_row(system.groups, system.restrict(states)))
        case ReachReward(reward, target):
            builder.reward(reward, target)
        case CoSafeReward():
            return _until_shown(context, quantity, direction)
        case CumulativeReward(reward, window):
            steps = window.steps().upper
            assert steps is not None
            return first_steps(context, system.step_rewards(reward), steps, direction)
        case DiscountedReward(reward, discount, None):
            builder.discounted(reward, discount)
        case DiscountedReward(reward, discount, steps):
            assert steps is not None
            return first_steps(context, system.step_rewards(reward), steps, direction, discount)
        case InstantaneousReward(reward, time):
            steps = Window(upper=time).steps().upper
            assert steps is not None
            last = system.state_rewards(reward)
            return first_steps(context, None, steps, direction, last=last)
        case TotalReward(reward) if context.engine.has_opponents:
            builder.kept(reward, context.engine.none)
        case EndedReward(reward, target, True):
            builder.kept(reward, target)
        case TotalReward(reward):
            builder.total(reward)
        case LongRunReward(reward):
            builder.average(system.step_rewards(reward))
        case _:
            raise UnsupportedError(f"strategies are not supported for {quantity.called}")
    return builder.strategy(direction)


def _of_path(context: Context, path: PathFormula[StateSet], direction: Direction) -> Strategy:
    from symcheck.check.omega_regular.ltl import as_until

    if isinstance(path, LtlPathFormula):
        path = as_until(context, path) or path
    positive, towards = path, direction
    if path.negative and isinstance(path, NextPath | UntilPath | RewardPath):
        positive, towards = negated(path), direction.dual
    builder = StrategyBuilder(context, towards)
    match positive:
        case UntilPath(left, right, window) if window.is_unbounded:
            builder.until(left, right)
        case NextPath(target, window) if window.is_unbounded:
            builder.next(target)
        case RewardPath(UntilPath(left, right), counts):
            return within_rewards(context, left, right, counts, towards, direction)
        case RewardPath() | StatePath():
            raise UnsupportedError(
                "strategies are not supported for X with a bound on a reward and for state formulas"
            )
        case UntilPath(left, right, window) if context.engine.has_opponents:
            return _within_steps(context, left, right, window, towards, direction)
        case NextPath() | LtlPathFormula() if context.engine.has_opponents:
            return _in_game(context, as_ltl(path), direction)
        case UntilPath() | NextPath():
            return temporal_strategy(context, as_ltl(path), direction)[0]
        case LtlPathFormula():
            return temporal_strategy(context, positive, direction)[0]
        case _:
            assert_never(positive)
    return builder.strategy(direction)


def _within_steps(
    context: Context,
    left: StateSet,
    right: StateSet,
    window: Window,
    towards: Direction,
    direction: Direction,
) -> Strategy:
    """A strategy of a game for a bounded until, which counts steps."""
    steps = window.steps()
    if steps.lower or steps.upper is None:
        raise UnsupportedError("strategies of games are supported for bounds from above only")
    goal = context.engine.system(context.engine.all).restrict(right)
    ended = context.engine.to_bools(right | ~left)
    return first_steps(context, None, steps.upper, towards, last=goal, ended=ended, of=direction)


def _in_game(context: Context, path: LtlPathFormula[StateSet], direction: Direction) -> Strategy:
    """A strategy of a game for a co-safe or a safe formula, on the product with its automaton."""
    from symcheck.check.omega_regular.ltl import co_safe_product, is_co_safe
    from symcheck.engines.explicit.product import ExplicitProduct

    towards = direction
    if not is_co_safe(context, path):
        path, towards = replace(path, negative=not path.negative), direction.dual
    if not is_co_safe(context, path):
        raise UnsupportedError(
            "strategies of games are supported for formulas that finite prefixes of runs decide"
        )
    product, accepting = co_safe_product(context, path)
    assert isinstance(product, ExplicitProduct)
    inner = context.on(product.engine)
    builder = StrategyBuilder(inner, towards)
    builder.until(product.engine.all, accepting)
    return builder.strategy(direction, product.pairs.automaton, product.entry)


def temporal_strategy(
    context: Context, path: LtlPathFormula[StateSet], direction: Direction
) -> tuple[Strategy, StateSet]:
    """A strategy of the product with an automaton; a minimum is the maximum of the negation.

    Returns:
        The strategy, and the states of its product from which it is accepted almost surely because
        they belong to an accepting end component.
    """
    from symcheck.check.omega_regular.ltl import linear_product
    from symcheck.engines.explicit.product import ExplicitProduct

    negative = path.negative is not (direction is Direction.MIN)
    product, pairs = linear_product(context, replace(path, negative=negative))
    assert isinstance(product, ExplicitProduct)
    inner = context.on(product.engine)
    builder = StrategyBuilder(inner, Direction.MAX)
    accepted = builder.accept(pairs)
    builder.until(product.engine.all, accepted)
    return builder.strategy(direction, product.pairs.automaton, product.entry), accepted


def _until_shown(
    context: Context, quantity: CoSafeReward[StateSet], direction: Direction
) -> Strategy:
    """A strategy for the reward until a run shows that it satisfies a path formula."""
    from symcheck.check.omega_regular.ltl import co_safe_product
    from symcheck.engines.explicit.product import ExplicitProduct

    product, accepting = co_safe_product(context, quantity.path)
    assert isinstance(product, ExplicitProduct)
    builder = StrategyBuilder(context.on(product.engine), direction)
    builder.reward(quantity.reward, accepting)
    return builder.strategy(direction, product.pairs.automaton, product.entry)
