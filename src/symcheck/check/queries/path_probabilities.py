"""The probability of a path formula at each state, and the states that satisfy a bound on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import assert_never

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measure_selection import timed_measures
from symcheck.check.measures.reachability import until
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.numerics.linear.problem import largest_width
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
    negated,
)
from symcheck.semantics.query import Threshold
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import Weights
from symcheck.syntax.operators import Operator

__all__ = ["complement_of", "defined_bounds", "probability", "qualitative"]


def _complement(context: Context, values: Values) -> Values:
    """The values 1 - values."""
    return context.engine.constant(1).map(Operator.MINUS, values)


def complement_of(context: Context, probabilities: Callable[[Context], Values]) -> Values:
    """The values 1 - p at each state, with the accuracy that is asked for at relevant states.

    The bounds of 1 - p are as far apart as those of p. Where 1 - p is small, this is relatively
    more, and p is computed again, more accurately.

    Args:
        context: the engine, the options and the log.
        probabilities: computes p with the accuracy of a context.
    """
    values = _complement(context, probabilities(context))
    states = context.engine.all if context.relevant_states is None else context.relevant_states
    epsilon = context.options.epsilon
    if context.engine.is_rational or not context.options.relative:
        return values
    if states.count > tuning.MAX_COMPARED_STATES:
        return values
    low, high = defined_bounds(values, states)
    if largest_width(low, high, relative=True) <= epsilon:
        return values
    least = float(high[high > 0].min())
    finer = context.with_epsilon(max(epsilon * least / 4, ROUNDING))
    values = _complement(context, probabilities(finer))
    context.warn_if_wide(
        largest_width(*defined_bounds(values, states), relative=True),
        "1 minus a probability has fewer digits",
    )
    return values


def defined_bounds(values: Values, states: StateSet) -> tuple[Numbers, Numbers]:
    """The bounds at those of the states that have a value: conditional ones may have none."""
    low, high = values.at(states)
    known = ~np.isnan(low)
    return low[known], high[known]


def probability(
    context: Context, path: PathFormula[StateSet], direction: Direction | None
) -> Values:
    """Probability of a path formula at each state.

    Args:
        context: the engine, the options and the log.
        path: the path formula.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Values in [0, 1], certified within `options.epsilon`.

    Raises:
        UnsupportedError: the model type or an option does not permit the formula.
    """
    if isinstance(path, UntilPath) and _decided(context, path):
        known = path.right | ~path.left
        satisfied = context.engine.indicator(known - path.right if path.negative else path.right)
        return satisfied.choose(known, context.engine.constant(0, 1))
    # A difference of rationals is exact; one of doubles loses the digits of a small probability.
    # In a game, the difference is taken: a side may ensure the complement by going on for ever.
    engine = context.engine
    intervals = engine.model.weights is Weights.INTERVALS
    by_difference = engine.is_rational or intervals or engine.has_opponents
    if isinstance(path, UntilPath) and path.negative and not by_difference:
        from symcheck.check.queries.complement_until import complement_until

        certain = _probability_zero(context, path.left, path.right, direction and direction.dual)
        return complement_until(context, path, direction, certain)
    if isinstance(path, NextPath) and path.negative and path.window.is_unbounded:
        return timed_measures(context).next_probability(
            context, ~path.target, path.window, direction
        )
    if path.negative and not isinstance(path, StatePath | LtlPathFormula):
        return complement_of(
            context, lambda c: probability(c, negated(path), direction and direction.dual)
        )
    match path:
        case StatePath(states, negative):
            return context.engine.indicator(~states if negative else states)
        case NextPath(target, window):
            return timed_measures(context).next_probability(context, target, window, direction)
        case UntilPath(left, right, window) if not window.is_unbounded:
            return timed_measures(context).bounded_until(
                context, path, direction, lambda c: until(c, left, right, direction)
            )
        case UntilPath(left, right) if context.options.fairness and direction is Direction.MIN:
            return _fair_minimum(context, left, right)
        case UntilPath(left, right):
            return until(context, left, right, direction)
        case RewardPath(inner, counts):
            from symcheck.check.measures import reward_bounded_until

            if isinstance(inner, NextPath):
                return reward_bounded_until.reward_bounded_next(
                    context, inner.target, counts, direction
                )
            return reward_bounded_until.reward_bounded_until(
                context, inner.left, inner.right, counts, direction
            )
        case LtlPathFormula():
            return _linear_time(context, path, direction)
        case _:
            assert_never(path)


def _decided(context: Context, path: UntilPath[StateSet]) -> bool:
    """Whether the model is large and the formula is decided at each relevant state by its sets."""
    if context.engine.is_rational:  # values that are not computed have bounds only
        return False
    relevant = context.relevant_states
    if (
        relevant is None
        or context.engine.states < tuning.LARGE_MODEL_STATES
        or not path.window.contains_zero
    ):
        return False
    return relevant <= path.right | ~path.left


def _linear_time(
    context: Context, path: LtlPathFormula[StateSet], direction: Direction | None
) -> Values:
    """Probability of an LTL formula: by an until if it is one, otherwise by an automaton.

    The least probability is 1 - the greatest one of the negation.
    """
    from symcheck.check.omega_regular.ltl import as_until, path_probability_ltl

    simple = as_until(context, path)
    if simple is not None:
        return probability(context, simple, direction)
    if context.engine.has_opponents:
        from symcheck.check.omega_regular.games import path_probability_in_game

        found = path_probability_in_game(context, path, direction)
        return found or complement_of(context, partial(_of_opposite_in_game, path, direction))
    if direction is Direction.MIN:
        opposite = replace(path, negative=not path.negative)
        return complement_of(context, lambda c: path_probability_ltl(c, opposite, Direction.MAX))
    return path_probability_ltl(context, path, direction)


def _of_opposite_in_game(
    path: LtlPathFormula[StateSet], direction: Direction | None, context: Context
) -> Values:
    """The probability of the negation of a formula in a game."""
    from symcheck.check.omega_regular.games import path_probability_in_game

    opposite = replace(path, negative=not path.negative)
    found = path_probability_in_game(context, opposite, direction and direction.dual)
    if found is None:
        raise UnsupportedError(
            "LTL formulas of games are supported if an automaton with one Rabin pair accepts them "
            "or their negations; this one needs more"
        )
    return found


def _fair_minimum(context: Context, left: StateSet, right: StateSet) -> Values:
    """Least probability of left U right over fair strategies.

    Under a fair strategy, a run almost surely reaches `right` or a state that cannot reach it. So
    the least probability of the former is 1 - the greatest one of the latter.

    Source: Baier & Kwiatkowska (1998).
    """
    impossible = ~context.engine.graph.exists_until(left, right)
    return complement_of(context, lambda c: until(c, left - right, impossible, Direction.MAX))


def qualitative(
    context: Context,
    path: PathFormula[StateSet],
    threshold: Threshold,
    direction: Direction | None,
) -> StateSet | None:
    """The states that satisfy a bound that graph analysis decides (>0, <=0, >=1, <1).

    None if the probabilities themselves are needed.
    """
    operator, value = threshold.operator, threshold.value
    if path.negative and isinstance(path, UntilPath | NextPath | RewardPath):
        opposite = Threshold(operator.mirrored, 1 - value)
        return qualitative(context, negated(path), opposite, direction and direction.dual)
    if threshold.admits(0) == threshold.admits(1):
        return context.engine.all if threshold.admits(0) else context.engine.none
    if value not in (0, 1):
        return None
    states = (
        _probability_one(context, path, direction)
        if value == 1
        else _probability_positive(context, path, direction)
    )
    if states is None:
        return None
    return states if operator.is_lower_bound else ~states


def _probability_positive(
    context: Context, path: PathFormula[StateSet], direction: Direction | None
) -> StateSet | None:
    """The states whose probability is positive; None: not decided by the graph."""
    match path:
        case UntilPath(_, _, window) if not window.is_unbounded:
            whenever = replace(path, window=Window())
            return timed_measures(context).prob_greater_zero(
                context, path, direction, lambda c: probability(c, whenever, direction)
            )
        case UntilPath(left, right, negative=False):
            return ~_probability_zero(context, left, right, direction)
        case NextPath() | RewardPath():
            # Computed upper bounds are 0 where the graph says so.
            zero, _ = probability(context, path, direction).compare("<=", 0)
            return ~zero
        case _:
            return None


def _probability_zero(
    context: Context, left: StateSet, right: StateSet, direction: Direction | None
) -> StateSet:
    graph = context.engine.graph
    if context.options.fairness and direction is Direction.MIN:
        return graph.prob1(left - right, ~graph.exists_until(left, right), Direction.MAX)
    return graph.prob0(left, right, direction)


def _probability_one(
    context: Context, path: PathFormula[StateSet], direction: Direction | None
) -> StateSet | None:
    """The states whose probability is 1; None: not decided by the graph."""
    dual = direction and direction.dual
    if isinstance(path, NextPath) and path.window.is_unbounded:
        positive = _probability_positive(context, replace(path, target=~path.target), dual)
        return None if positive is None else ~positive
    if not isinstance(path, UntilPath):
        return None
    if not path.window.is_unbounded:
        positive = _probability_positive(context, negated(path), dual)
        return None if positive is None else ~positive
    graph = context.engine.graph
    if context.options.fairness and direction is Direction.MIN:
        return graph.prob0(
            path.left - path.right, ~graph.exists_until(path.left, path.right), Direction.MAX
        )
    return graph.prob1(path.left, path.right, direction)
