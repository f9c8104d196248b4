"""Conditional probabilities: P(path | condition), written `P=? [ path || condition ]`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.queries.path_probabilities import complement_of, defined_bounds, probability
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, Values, bracket
from symcheck.errors import Diagnostic, InputError, NumericalError, UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.numerics import rational_limits
from symcheck.numerics.linear.problem import largest_width
from symcheck.semantics.path_formulas import PathFormula, UntilPath
from symcheck.semantics.query import ProbabilityGiven
from symcheck.syntax.operators import Operator

__all__ = ["conditional_probability"]

SMALLEST_NORMAL = float(np.finfo(np.float64).tiny)


def conditional_probability(
    context: Context,
    quantity: ProbabilityGiven[StateSet],
    direction: Direction | None,
    exactly: Callable[[StateSet], Numbers] | None = None,
) -> Values:
    """Probability of a path formula given another one, at each state.

    In a chain, it is the quotient P(path & condition) / P(condition). In an MDP, path and condition
    are reachability, and strategies range over those with a positive probability of the condition.
    Where the condition is so improbable that doubles do not give the requested accuracy, rational
    arithmetic does.

    Args:
        context: the engine, the options and the log.
        quantity: the path formula and its condition.
        direction: minimise or maximise over strategies; None for a chain.
        exactly: gives the rationals at some states; may raise SymcheckError. None: nothing does.

    Returns:
        Values in [0, 1]; NaN where the probability of the condition is 0.

    Raises:
        InputError: a relevant state has probability 0 of the condition.
        UnsupportedError: the model type or an option does not permit the formulas.
    """
    # The error of a quotient is twice that of its parts, whose errors must be relative to be small.
    options = replace(context.options, epsilon=context.options.epsilon / 4, relative=True)
    parts_log = replace(context.log, warnings=[])  # the width of the parts is not that of the value
    inner = replace(context, options=options, log=parts_log)
    path, condition = quantity.path, quantity.condition
    if direction is None:
        given = probability(inner, condition, None)
        undefined = given.compare("=", 0)[0]
        values = probability(inner, quantity.both, None).map(Operator.DIVIDE, given)
    else:
        values, undefined = _of_mdp(inner, path, condition, direction)
        finer = _finer(context, values)
        if finer is not None:
            values, _ = _of_mdp(inner.with_epsilon(finer), path, condition, direction)
    _refuse_undefined(context, quantity, undefined, direction)
    relevant = _compared(context) - undefined
    if context.engine.is_rational or relevant.count > tuning.CONDITIONAL_STATES:
        for warning in parts_log.warnings:
            context.log.warn(warning)
        return values
    return _accurate(context, values, relevant, exactly) if relevant else values


def _accurate(
    context: Context,
    values: Values,
    relevant: StateSet,
    exactly: Callable[[StateSet], Numbers] | None,
) -> Values:
    """The values, by rational arithmetic where the bounds are wider than requested.

    Args:
        context: the engine, the options and the log.
        values: bounds on the values.
        relevant: the states that are asked for, where the values are defined.
        exactly: see `conditional_probability`.
    """
    engine = context.engine
    low, high = values.at(relevant)
    wide = [
        not largest_width(low[i : i + 1], high[i : i + 1], context.options.relative)
        <= context.options.epsilon
        for i in range(len(low))
    ]
    if not any(wide):
        return values
    members = engine.to_bools(relevant)
    members[members] = wide
    states = engine.from_bools(members)
    if exactly is None or engine.states > rational_limits.CONDITIONAL_STATES:
        reason = f"the model has {engine.states:,} states"
    else:
        try:
            exact = exactly(states)
        except (UnsupportedError, NumericalError) as error:
            reason = str(error)
        else:
            for number, value in zip(np.flatnonzero(members).tolist(), exact, strict=True):
                one = np.zeros_like(members)
                one[number] = True
                values = _nearest(context, value).choose(engine.from_bools(one), values)
            return values
    context.warn_if_wide(
        largest_width(low, high, context.options.relative),
        f"the condition is improbable, and rational arithmetic is not used: {reason}",
    )
    return values


def _finer(context: Context, values: Values) -> float | None:
    """The accuracy with which 1 minus a probability is accurate enough; None where it is."""
    if context.engine.is_rational or not context.options.relative:
        return None
    low, high = defined_bounds(values, _compared(context))
    epsilon = context.options.epsilon
    if largest_width(low, high, relative=True) <= epsilon:
        return None
    return max(epsilon * float(high[high > 0].min()) / 4, ROUNDING)


def _compared(context: Context) -> StateSet:
    """The states whose values need the requested accuracy."""
    return context.engine.all if context.relevant_states is None else context.relevant_states


def _nearest(context: Context, value: Fraction) -> Values:
    """The constant that is nearest to a rational, or bounds where there are no normal doubles."""
    engine, double = context.engine, float(value)
    if value == Fraction(double):
        return engine.constant(double)
    if double >= SMALLEST_NORMAL:
        return engine.constant(*bracket(value), rounded=True)
    context.warn_if_wide(1.0, "the value is below the doubles")
    return engine.constant(0, SMALLEST_NORMAL)


def _refuse_undefined(
    context: Context,
    quantity: ProbabilityGiven[StateSet],
    undefined: StateSet,
    direction: Direction | None,
) -> None:
    """Raise InputError if the condition has probability 0 in a state that matters."""
    relevant = context.engine.initial if context.options.everywhere else context.relevant_states
    if relevant is not None and undefined & relevant:
        where = context.example(undefined & relevant)
        best = "" if direction is None else "greatest "
        raise InputError(
            Diagnostic(
                f"the conditional probability is undefined in state {where}: the {best}probability "
                "of the condition is 0",
                quantity.span,
                "condition",
            )
        )


def _of_mdp(
    context: Context,
    path: PathFormula[StateSet],
    condition: PathFormula[StateSet],
    direction: Direction,
) -> tuple[Values, StateSet]:
    """The values, and the states where they are undefined."""
    engine = context.engine
    target, given = _reached(context, path), _reached(context, condition)
    if target is None or given is None or condition.negative:
        raise UnsupportedError(
            "conditional probabilities of an MDP are supported for F a || F b and G a || F b over "
            "states, without bounds; those of a DTMC or CTMC for all path formulas"
        )
    from symcheck.check.measures.conditional_reachability import conditional_reachability

    towards = direction.dual if path.negative else direction

    def probabilities(inner: Context) -> Values:
        return conditional_reachability(inner, target, given, towards)

    values = complement_of(context, probabilities) if path.negative else probabilities(context)
    return values, engine.graph.prob0(engine.all, given, Direction.MAX)


def _reached(context: Context, path: PathFormula[StateSet]) -> StateSet | None:
    """The states that a formula F or its negation speaks of; None for other formulas."""
    if isinstance(path, UntilPath) and path.window.is_unbounded and path.left == context.engine.all:
        return path.right
    return None
