"""What a property asks for, as a value: a quantity, its direction, and its threshold.

A query is resolved once, from the formula. Values, strategies, counterexamples, samples, parts of a
cluster and pages interpret it; none of them reads the formula again. Like its path formulas it is
generic in its leaves: state formulas, or the sets of states that satisfy them in an engine.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import ClassVar, Generic, TypeVar, assert_never, cast

from symcheck.direction import Direction
from symcheck.errors import Diagnostic, InputError, Span, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate_constant
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
    as_ltl,
    over_leaves,
    path_formula,
)
from symcheck.semantics.rewards import Reward, Time, operator_reward
from symcheck.semantics.time_bounds import RewardWindow, Window, bound_value, counts, window
from symcheck.syntax import ast
from symcheck.syntax.ast import Expression, ModelType, Weights
from symcheck.syntax.operators import Operator

__all__ = [
    "CoSafeReward",
    "CostBoundedReward",
    "CumulativeReward",
    "DiscountedReward",
    "EndedReward",
    "ExpectedReward",
    "InstantaneousReward",
    "LongRunProbability",
    "LongRunReward",
    "PathProbability",
    "ProbabilityGiven",
    "Quantity",
    "Query",
    "ReachReward",
    "Threshold",
    "TotalReward",
    "direction_of",
    "query_of",
    "threshold_of",
]

L = TypeVar("L")
M = TypeVar("M")

_COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


@dataclass(frozen=True, slots=True)
class Threshold:
    """A comparison (one of < <= > >=) with a number."""

    operator: Operator
    value: Fraction

    def admits(self, value: float | Fraction) -> bool:
        """Whether a value satisfies the comparison."""
        return bool(_COMPARE[self.operator](value, self.value))


# --------------------------------------------------------------------------------------- quantities


class _Quantity:
    """A value for each state. The defaults of what a quantity declares are safe for any of them.

    called: its name in messages, in the plural.
    """

    __slots__ = ()

    called: ClassVar[str] = "expected rewards"

    @property
    def fair_directions(self) -> tuple[Direction, ...]:
        """The directions in which it is computed over fair strategies if these are asked for."""
        return ()

    @property
    def feature(self) -> Feature:
        """What a class of models has to offer for it."""
        raise NotImplementedError


_BOTH = tuple(Direction)
"""Finitely many steps decide, and any strategy is fair thereafter."""


@dataclass(frozen=True, slots=True)
class PathProbability(_Quantity, Generic[L]):
    """The probability of a path formula."""

    called = "probabilities with bounds on rewards"

    path: PathFormula[L]

    @property
    def fair_directions(self) -> tuple[Direction, ...]:
        """Both, but for bounds on rewards."""
        return () if isinstance(self.path, RewardPath) else _BOTH

    @property
    def feature(self) -> Feature:
        """That of its path formula."""
        match self.path:
            case StatePath() | NextPath():
                return Feature.REACHABILITY
            case UntilPath(window=window) if window.is_unbounded:
                return Feature.REACHABILITY
            case UntilPath():
                return Feature.BOUNDED_REACHABILITY
            case LtlPathFormula():
                return Feature.LTL
            case RewardPath():
                return Feature.REWARD_BOUNDS
            case _:
                assert_never(self.path)


@dataclass(frozen=True, slots=True)
class ProbabilityGiven(_Quantity, Generic[L]):
    """The probability of a path formula, given that a condition holds.

    both: their conjunction.
    """

    called = "conditional probabilities"
    feature = Feature.CONDITIONAL

    path: PathFormula[L]
    condition: PathFormula[L]
    both: PathFormula[L]
    span: Span


@dataclass(frozen=True, slots=True)
class LongRunProbability(_Quantity, Generic[L]):
    """The long-run fraction of the time that is spent in some states."""

    called = "long-run averages"
    feature = Feature.LONG_RUN

    states: L


@dataclass(frozen=True, slots=True)
class LongRunReward(_Quantity):
    """The long-run average of a reward per step or unit of time."""

    called = "long-run averages"
    feature = Feature.LONG_RUN

    reward: Reward


@dataclass(frozen=True, slots=True)
class ReachReward(_Quantity, Generic[L]):
    """The reward that is earned until a target is reached; infinite if it is missed."""

    feature = Feature.REACH_REWARDS

    reward: Reward
    target: L


@dataclass(frozen=True, slots=True)
class CoSafeReward(_Quantity, Generic[L]):
    """The reward that is earned until a run shows that it satisfies a path formula."""

    feature = Feature.REACH_REWARDS

    reward: Reward
    path: LtlPathFormula[L]


@dataclass(frozen=True, slots=True)
class TotalReward(_Quantity):
    """The reward of all steps."""

    feature = Feature.TOTAL_REWARDS
    # Fairness affects only the least value: staying where no reward is earned is unfair.
    fair_directions = (Direction.MAX,)

    reward: Reward


@dataclass(frozen=True, slots=True)
class CumulativeReward(_Quantity):
    """The reward up to the upper end of a window that begins at 0."""

    feature = Feature.CUMULATIVE_REWARDS
    fair_directions = _BOTH

    reward: Reward
    window: Window


@dataclass(frozen=True, slots=True)
class EndedReward(_Quantity, Generic[L]):
    """The reward that is earned until a target is reached; a run that misses it keeps what it earns
    for ever (`kept`), or gets nothing.
    """

    called = "the reward F0, which need memory"
    feature = Feature.ENDED_REWARDS

    reward: Reward
    target: L
    kept: bool


@dataclass(frozen=True, slots=True)
class CostBoundedReward(_Quantity):
    """The reward of the steps whose accumulated cost is within a window."""

    called = "rewards within a cost"
    feature = Feature.REWARD_BOUNDS

    reward: Reward
    cost: RewardWindow


@dataclass(frozen=True, slots=True)
class DiscountedReward(_Quantity):
    """The reward of the first steps (None: of all), of which step i counts discount^i times."""

    called = "discounted rewards"
    feature = Feature.DISCOUNTED_REWARDS
    fair_directions = _BOTH

    reward: Reward
    discount: Fraction
    steps: int | None


@dataclass(frozen=True, slots=True)
class InstantaneousReward(_Quantity):
    """The reward of the state at a time."""

    feature = Feature.INSTANTANEOUS_REWARDS
    fair_directions = _BOTH

    reward: Reward
    time: Fraction


ExpectedReward = (
    ReachReward[L]
    | CoSafeReward[L]
    | TotalReward
    | CumulativeReward
    | CostBoundedReward
    | DiscountedReward
    | EndedReward[L]
    | InstantaneousReward
    | LongRunReward
)
Quantity = PathProbability[L] | ProbabilityGiven[L] | LongRunProbability[L] | ExpectedReward[L]


@dataclass(frozen=True, slots=True)
class Query(Generic[L]):
    """A quantity, optimised over strategies, and compared with a threshold.

    Attributes:
        quantity: what is asked for.
        direction: minimise or maximise it over strategies; None in a model without choices.
        threshold: None: its value is asked for.
        nature: with intervals of probabilities, minimise or maximise it over what nature chooses
            from them when it knows the strategy; None where probabilities are numbers.
        coalition: the players of a game who choose in that direction, numbered from 0, where the
            others choose against it; None: all choose in it.
    """

    quantity: Quantity[L]
    direction: Direction | None
    threshold: Threshold | None
    nature: Direction | None = None
    coalition: frozenset[int] | None = None

    def over(self, leaf: Callable[[L], M]) -> Query[M]:
        """The query with `leaf` of each state formula in its place."""
        quantity: Quantity[M]
        match self.quantity:
            case PathProbability(path):
                quantity = PathProbability(over_leaves(path, leaf))
            case ProbabilityGiven(path, condition, both, span):
                quantity = ProbabilityGiven(
                    over_leaves(path, leaf),
                    over_leaves(condition, leaf),
                    over_leaves(both, leaf),
                    span,
                )
            case LongRunProbability(states):
                quantity = LongRunProbability(leaf(states))
            case ReachReward(reward, target):
                quantity = ReachReward(reward, leaf(target))
            case EndedReward(reward, target, kept):
                quantity = EndedReward(reward, leaf(target), kept)
            case CoSafeReward(reward, path):
                atoms = tuple(map(leaf, path.atoms))
                ltl = LtlPathFormula(path.form, atoms, path.negative, path.span)
                quantity = CoSafeReward(reward, ltl)
            case TotalReward() | CumulativeReward() | CostBoundedReward() | LongRunReward():
                quantity = self.quantity
            case DiscountedReward() | InstantaneousReward():
                quantity = self.quantity
            case _:
                assert_never(self.quantity)
        return Query(quantity, self.direction, self.threshold, self.nature, self.coalition)


# --------------------------------------------------------------------------------------- resolution


def query_of(formula: ast.AnyMeasure, model: BoundModel) -> Query[Expression]:
    """What a bound measure asks for.

    Raises:
        InputError: the threshold is infinite, a direction is missing, or a bound is faulty.
        UnsupportedError: the model has no such direction, or there is no such reward.
    """
    threshold = None if formula.bound is None else threshold_of(formula.bound)
    nature = None
    if model.weights is Weights.INTERVALS:
        direction, nature = _directions_with_nature(formula, model.type)
    else:
        direction = direction_of(formula, model.type)
    quantity = _quantity(formula, model)
    if model.clocks is not None and not model.clocks.for_property:
        raise UnsupportedError(
            f"{quantity.feature.value} of timed automata are not values of the states that are "
            "listed: each property has states of its own"
        )
    require(model, quantity.feature)
    together = None
    if formula.coalition is not None:
        from symcheck.semantics.players import members

        together = members(formula.coalition, model)
    return Query(quantity, direction, threshold, nature, together)


def _directions_with_nature(
    formula: ast.Measure, kind: ModelType
) -> tuple[Direction | None, Direction]:
    """The directions of a strategy (None without choices) and of nature.

    A bound without a direction must hold for all strategies and all that nature may choose.

    Raises InputError: a direction is missing, or there is one too many.
    """
    given, letter = formula.direction, formula.letter
    expected = ("minmin", "minmax", "maxmin", "maxmax") if kind.has_choices else ("min", "max")
    if given is None and formula.bound is not None:
        worst = Direction.MIN if formula.bound.operator.is_lower_bound else Direction.MAX
        return (worst if kind.has_choices else None), worst
    if given is None or given not in expected:
        about = f"{letter}{given or ''}=? has no unique value in a model with intervals"
        who = "a direction of strategies and one of nature" if kind.has_choices else "a direction"
        hint = f"{who}: " + ", ".join(f"{letter}{d}=?" for d in expected)
        raise InputError(Diagnostic(about, formula.span, "direction", hint))
    first, second = given[:3], given[-3:]
    return (Direction(first) if kind.has_choices else None), Direction(second)


def threshold_of(bound: ast.Bound) -> Threshold:
    """The comparison of a bound. Raises InputError if it is with no finite number."""
    value = evaluate_constant(bound.threshold)
    if isinstance(value, float):
        raise InputError(
            Diagnostic("a threshold must be a finite number", bound.threshold.span, "threshold")
        )
    return Threshold(bound.operator, Fraction(value))


def direction_of(formula: ast.Measure, kind: ModelType) -> Direction | None:
    """The direction of a measure; None if the model has no choices.

    A bound without a direction must hold under all strategies.

    Raises:
        InputError: there is neither a direction nor a bound.
        UnsupportedError: the direction is that of another class of models.
    """
    if not kind.has_choices:
        return None
    given, letter = formula.direction, formula.letter
    if given in ("min", "max"):
        return Direction(given)
    if given is not None:
        raise UnsupportedError(
            f"{letter}{given} is not supported on {kind.one}; {letter}min and {letter}max are"
        )
    if formula.bound is None:
        message = f"{letter}=? has no single value in {kind.one}"
        raise InputError(
            Diagnostic(message, formula.span, "direction", f"use {letter}min=? or {letter}max=?")
        )
    # A coalition has a strategy for the bound; otherwise it holds under all strategies.
    exists = formula.coalition is not None and not formula.coalition.against
    return Direction.MAX if formula.bound.operator.is_lower_bound == exists else Direction.MIN


def _quantity(formula: ast.AnyMeasure, model: BoundModel) -> Quantity[Expression]:
    match formula:
        case ast.ProbabilityOperator(path=path):
            return PathProbability(path_formula(path, model))
        case ast.ConditionalProbability(path=path, condition=condition):
            parts = cast(Expression, path), cast(Expression, condition)
            both = ast.Binary(Operator.AND, *parts, span=formula.span)
            return ProbabilityGiven(
                path_formula(path, model),
                path_formula(condition, model),
                path_formula(both, model),
                condition.span,
            )
        case ast.SteadyState(formula=states):
            return LongRunProbability(states)
        case ast.ExpectedTime(path=path):
            return _until_shown(Time(), path, model)
        case ast.RewardOperator(query=query):
            return _expected(operator_reward(formula, model), query, model)
        case _:
            assert_never(formula)


def _expected(
    reward: Reward, query: ast.RewardQuery, model: BoundModel
) -> ExpectedReward[Expression]:
    match query:
        case ast.CumulativeReward(bound):
            time = window(bound)
            if time.upper is None or not time.contains_zero:
                raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
            return CumulativeReward(reward, time)
        case ast.CostBoundedReward(bound):
            costs = counts(bound, model)
            if len(costs) > 1:
                raise UnsupportedError("a cumulative reward within one cost is supported, not more")
            return CostBoundedReward(reward, costs[0])
        case ast.DiscountedReward(bound, discount):
            steps = None if bound is None else window(bound).steps().upper
            # Binding has checked that the discount is from 0 to less than 1.
            return DiscountedReward(reward, Fraction(evaluate_constant(discount)), steps)
        case ast.TotalReward():
            return TotalReward(reward)
        case ast.EndedReward(kept, target):
            return EndedReward(reward, target, kept)
        case ast.InstantaneousReward(time_of):
            return InstantaneousReward(reward, bound_value(time_of))
        case ast.SteadyStateReward():
            return LongRunReward(reward)
        case ast.ExpressionNode() | ast.UnaryTemporal() | ast.BinaryTemporal():
            return _until_shown(reward, query, model)
        case _:
            assert_never(query)


def _until_shown(
    reward: Reward, path: ast.PathFormula, model: BoundModel
) -> ReachReward[Expression] | CoSafeReward[Expression]:
    form = path_formula(path, model)
    if (
        isinstance(path, ast.Eventually)
        and isinstance(form, UntilPath)
        and form.window.is_unbounded
    ):
        return ReachReward(reward, form.right)
    return CoSafeReward(reward, replace(as_ltl(form), span=path.span))
