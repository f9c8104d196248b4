"""Rational functions from expressions over parameters."""

from __future__ import annotations

from collections.abc import Mapping

from symcheck.errors import Diagnostic, ModelFault
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.semantics.binding.parameters import FIELD, check_function, no_function
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Name, Unary
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["function_of", "function_of_text"]


def function_of(
    expression: Expression, field: FunctionField, values: Mapping[str, Value]
) -> RationalFunction:
    """The function that an expression is, given the values of its other names.

    Args:
        expression: as `check_function` admits it.
        field: the functions of the parameters.
        values: of the other names.

    Raises ModelFault: a number is infinite, there is a division by 0, or a power is not whole.
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
            if power % 1:
                raise no_function(expression, f"the power {power} is no rational function")
            return function_of(base, field, values) ** int(power)
        case Binary(operator, left, right):
            f, g = function_of(left, field, values), function_of(right, field, values)
            if not g and operator is Operator.DIVIDE:
                raise ModelFault(Diagnostic("division by 0", expression.span, "number"))
            function: RationalFunction = FIELD[operator](f, g)
            return function
        case _:
            raise AssertionError(f"{expression} is not checked")


def function_of_text(
    text: str, field: FunctionField, values: Mapping[str, Value]
) -> RationalFunction:
    """The function that a text such as `-p/(2*p-4)` denotes.

    Raises SymcheckError: it denotes none.
    """
    from symcheck.syntax.parse import parse_expression

    expression = parse_expression(text)
    check_function(field.names, expression)
    return function_of(expression, field, values)
