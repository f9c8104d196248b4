"""Values of expressions over variables, without the rounding of doubles where that is possible."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.engines.base import ROUNDING, Engine, Values
from symcheck.engines.capabilities import HasRationalTwin
from symcheck.errors import ModelFault
from symcheck.matrices.numbers import Rationals, rationals
from symcheck.numerics import rational_limits
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import LARGEST_WHOLE
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Conditional, Expression, Name, Type
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import nodes

__all__ = ["expression_values", "in_doubles"]


def expression_values(context: Context, formula: Expression) -> Values | None:
    """The value of a numeric expression over variables at each state.

    They are rational if the expression has rational values and the model has few states. Otherwise,
    ints are exact as far as doubles hold them.

    Returns:
        None if the expression has to be computed from its operands, whose rounding is known.

    Raises:
        ModelFault: the expression has no value in a reachable state.
    """
    engine, kind = context.engine, context.type(formula)
    if engine.is_rational:
        return engine.values(formula, kind)
    read = {n.name for n in nodes(formula) if isinstance(n, Name)}
    if not read or (
        engine.states <= rational_limits.STATES and engine.capability(HasRationalTwin) is None
    ):
        try:
            return engine.rationals(_rational_values(engine, formula, read))
        except ModelFault:
            pass  # it is irrational, or the engine tells the fault and the state
    if _is_whole(context, formula):
        values = engine.values(formula, kind)
        low, high = values.minimum(engine.all)[0], values.maximum(engine.all)[1]
        return values if max(-low, high) <= LARGEST_WHOLE else _rounded(engine, values)
    if isinstance(formula, Conditional):  # the operand that is not chosen may be faulty
        return _rounded(engine, engine.values(formula, kind))
    return None


def in_doubles(engine: Engine, values: Values) -> Values:
    """Values as doubles, for operators whose values are irrational."""
    return values if engine.is_rational else engine.constant(0).map(Operator.PLUS, values)


def _rounded(engine: Engine, values: Values) -> Values:
    near = engine.constant(1 - ROUNDING, 1 + ROUNDING, rounded=True)
    return values.map(Operator.TIMES, near)


def _is_whole(context: Context, formula: Expression) -> bool:
    """Whether an expression has no operand of type double."""
    return all(
        context.type(node) is not Type.DOUBLE
        for node in nodes(formula)
        if isinstance(node, Expression)
    )


def _rational_values(engine: Engine, formula: Expression, read: set[str]) -> Rationals:
    """The value in each state; one if the expression reads no variable."""
    if not read:
        return rationals([evaluate(formula, {}, exact=True)])
    variables = engine.model.variables
    positions = [i for i, v in enumerate(variables) if v.name in read]
    names = [variables[i].name for i in positions]
    known: dict[tuple[Value, ...], Value] = {}
    result: list[Value] = []
    for state in engine.valuations(engine.all):
        key = tuple([state[i] for i in positions])
        if key not in known:
            known[key] = evaluate(formula, dict(zip(names, key, strict=True)), exact=True)
        result.append(known[key])
    return rationals(result)
