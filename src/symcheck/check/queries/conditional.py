"""Conditional probabilities: P(path | condition), written `P=? [ path || condition ]`."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from symcheck.check.context import Context
from symcheck.check.path_formulas import Path, StatesOf, UntilPath, resolve
from symcheck.check.queries.path_probabilities import complement_of, probability
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.syntax.ast import Binary, ConditionalProbability, Expression
from symcheck.syntax.operators import Operator

__all__ = ["conditional_probability"]


def conditional_probability(
    context: Context,
    formula: ConditionalProbability,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
    """Probability of a path formula given another one, at each state.

    In a chain, it is the quotient P(path & condition) / P(condition). In an MDP, path and condition
    are reachability, and strategies range over those with a positive probability of the condition.

    Args:
        context: the engine, the options and the log.
        formula: the path formula and its condition.
        states_of: gives the states that satisfy a state formula.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Values in [0, 1]; NaN where the probability of the condition is 0.

    Raises:
        InputError: a relevant state has probability 0 of the condition.
        UnsupportedError: the model type or an option does not permit the formulas.
    """
    # The error of a quotient is twice that of its parts, whose errors must be relative to be small.
    options = replace(context.options, epsilon=context.options.epsilon / 4, relative=True)
    inner = replace(context, options=options)
    condition = resolve(formula.condition, states_of, context.engine)
    if direction is None:
        parts = cast(Expression, formula.path), cast(Expression, formula.condition)
        both = Binary(Operator.AND, *parts, span=formula.span)
        given = probability(inner, condition, None)
        joint = probability(inner, resolve(both, states_of, context.engine), None)
        undefined = given.compare("=", 0)[0]
        values = joint.map("/", given)
    else:
        path = resolve(formula.path, states_of, context.engine)
        values, undefined = _of_mdp(inner, path, condition, direction)
    relevant = context.engine.initial if context.options.everywhere else context.relevant_states
    if relevant is not None and undefined & relevant:
        where = context.example(undefined & relevant)
        best = "" if direction is None else "greatest "
        raise InputError(
            Diagnostic(
                f"the conditional probability is undefined in state {where}: the {best}probability "
                "of the condition is 0",
                formula.condition.span,
                "condition",
            )
        )
    return values


def _of_mdp(
    context: Context, path: Path, condition: Path, direction: Direction
) -> tuple[Values, StateSet]:
    """The values, and the states where they are undefined."""
    engine = context.engine
    if context.options.fairness:
        raise UnsupportedError("conditional probabilities over fair strategies are not supported")
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


def _reached(context: Context, path: Path) -> StateSet | None:
    """The states that a formula F or its negation speaks of; None for other formulas."""
    if isinstance(path, UntilPath) and path.window.trivial and path.left == context.engine.all:
        return path.right
    return None
