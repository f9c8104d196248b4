"""Rational functions from expressions over parameters."""

from __future__ import annotations

import operator as op
from collections.abc import Callable, Mapping

from symcheck.errors import Diagnostic, ModelFault, UnsupportedError
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Name, Unary
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["FIELD", "function_of", "function_of_text"]

FIELD: Mapping[object, Callable[[RationalFunction, RationalFunction], RationalFunction]] = {
    Operator.PLUS: op.add,
    Operator.MINUS: op.sub,
    Operator.TIMES: op.mul,
    Operator.DIVIDE: op.truediv,
}
"""The operators whose values are rational functions."""


def function_of(
    expression: Expression, field: FunctionField, values: Mapping[str, Value]
) -> RationalFunction:
    """The function that an expression is, given the values of its other names.

    Raises:
        ModelFault: a number is infinite, or there is a division by 0.
        UnsupportedError: an operator gives no rational function.
    """
    if names(expression).isdisjoint(field.names):
        value = evaluate(expression, values, exact=True)
        if isinstance(value, float):
            raise ModelFault(Diagnostic(f"this number is {value}", expression.span, "number"))
        return field.constant(value)
    match expression:
        case Name(name):
            return field.parameter(name)
        case Unary(_, operand):
            return -function_of(operand, field, values)
        case Conditional(condition, then, otherwise):
            holds = evaluate(condition, values, exact=True)
            return function_of(then if holds else otherwise, field, values)
        case Binary(Operator.POWER, base, exponent) | Call(_, (base, exponent)):
            power = evaluate(exponent, values, exact=True)
            if power != int(power):
                raise UnsupportedError(f"the power {power} of a parameter is no rational function")
            return function_of(base, field, values) ** int(power)
        case Binary(operator, left, right) if operator in FIELD:
            f, g = function_of(left, field, values), function_of(right, field, values)
            if not g and operator is Operator.DIVIDE:
                raise ModelFault(Diagnostic("division by 0", expression.span, "number"))
            return FIELD[operator](f, g)
        case _:
            raise UnsupportedError(
                "only sums, products, quotients and powers of parameters are rational functions"
            )


def function_of_text(
    text: str, field: FunctionField, values: Mapping[str, Value]
) -> RationalFunction:
    """The function that a text such as `-p/(2*p-4)` denotes.

    Raises SymcheckError: it denotes none.
    """
    from symcheck.syntax.parse import parse_expression

    return function_of(parse_expression(text), field, values)
