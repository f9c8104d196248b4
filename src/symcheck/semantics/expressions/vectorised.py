"""Evaluation of an expression on many states at once, with numpy.

Columns may have any shapes that broadcast together. On an open mesh (one axis per variable) each subexpression is
evaluated only over the domain of its own variables, so that a table over 2**20 valuations costs few full-size operations.

Unlike the scalar evaluator, this one never raises for a value that has no meaning (a division by zero in `mod`, a
negative exponent of an integer power, an integer beyond 2**62): that lane becomes NaN, because a table holds valuations
that no state may ever take. The caller reports NaN where a reachable state meets it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Filter,
    LabelReference,
    Literal,
    MultiObjective,
    Name,
    PathQuantifier,
    ProbabilityOperator,
    RewardOperator,
    StateFilter,
    SteadyState,
    Type,
    Unary,
)

__all__ = ["Column", "evaluate_columns"]

Column = NDArray[Any]
_LARGE = 2.0**62


def evaluate_columns(expression: Expression, columns: Mapping[str, Column]) -> Column:
    """The value of `expression` for each lane of the columns.

    `columns` maps variable names to bool or int64 arrays. The result is bool, int64 or float64 and has the shape that
    the columns of the variables that occur broadcast to (0-dimensional for a constant). An expression of integer type
    comes as float64 where some lane has no integer value (NaN there). Raises KeyError for a variable without column
    and TypeError for a node that is not arithmetic.
    """
    with np.errstate(all="ignore"):
        return _evaluate(expression, columns)


def _evaluate(expression: Expression, columns: Mapping[str, Column]) -> Column:
    match expression:
        case Literal(value, kind):
            return np.asarray(value if kind is not Type.DOUBLE else float(value))
        case Name(name):
            return columns[name]
        case Unary("!", operand):
            return np.asarray(~_evaluate(operand, columns))
        case Unary(_, operand):
            return np.asarray(-_evaluate(operand, columns))
        case Binary(operator, left, right):
            return _BINARY[operator](_evaluate(left, columns), _evaluate(right, columns))
        case Conditional(condition, then, otherwise):
            return np.where(
                _evaluate(condition, columns),
                _evaluate(then, columns),
                _evaluate(otherwise, columns),
            )
        case Call(function, arguments):
            return _CALLS[function](*(_evaluate(a, columns) for a in arguments))
        case (
            LabelReference()
            | ProbabilityOperator()
            | RewardOperator()
            | SteadyState()
            | PathQuantifier()
            | Filter()
            | StateFilter()
            | MultiObjective()
        ):
            raise TypeError(f"not an arithmetic expression: {type(expression).__name__}")
        case _:
            assert_never(expression)


def _integers(*values: Column) -> bool:
    return all(v.dtype.kind == "i" for v in values)


def _whole(values: Column) -> Column:
    """Whole-numbered floats as int64, where all lanes allow it."""
    values = np.asarray(values)
    return (
        values.astype(np.int64)
        if bool(np.all(np.abs(values) < _LARGE))
        else np.where(np.abs(values) < _LARGE, values, np.nan)
    )


def _power(base: Column, exponent: Column) -> Column:
    value = np.asarray(np.power(base.astype(np.float64), exponent.astype(np.float64)))
    if not _integers(base, exponent):
        return value
    value = np.where(exponent < 0, np.nan, value)
    if bool(np.all(np.abs(value) < _LARGE)):
        return np.asarray(np.power(base, exponent))
    return _whole(value)


def _modulo(dividend: Column, divisor: Column) -> Column:
    if _integers(dividend, divisor) and bool(np.all(divisor > 0)):
        return np.asarray(np.mod(dividend, divisor))
    remainder = np.fmod(dividend.astype(np.float64), divisor.astype(np.float64))
    return _whole(
        np.where(remainder < 0, remainder + divisor, remainder)
    )  # no value, NaN, for a divisor of 0


def _logarithm(value: Column, base: Column) -> Column:
    x, b = value.astype(np.float64), base.astype(np.float64)
    meaningful = (b > 0) & (b != 1) & (b != np.inf) & (x >= 0)
    return np.where(meaningful, np.log(x) / np.log(b), np.nan)


def _fold(operator: Callable[[Column, Column], Column], *values: Column) -> Column:
    result = values[0]
    for value in values[1:]:
        result = operator(result, value)
    return result


_BINARY: Mapping[str, Callable[[Column, Column], Column]] = {
    "+": lambda x, y: np.asarray(x + y),
    "-": lambda x, y: np.asarray(x - y),
    "*": lambda x, y: np.asarray(x * y),
    "/": lambda x, y: np.asarray(np.true_divide(x, y)),
    "^": _power,
    "=": lambda x, y: np.asarray(x == y),
    "!=": lambda x, y: np.asarray(x != y),
    "<": lambda x, y: np.asarray(x < y),
    "<=": lambda x, y: np.asarray(x <= y),
    ">": lambda x, y: np.asarray(x > y),
    ">=": lambda x, y: np.asarray(x >= y),
    "&": lambda x, y: np.asarray(x & y),
    "|": lambda x, y: np.asarray(x | y),
    "=>": lambda x, y: np.asarray(~x | y),
    "<=>": lambda x, y: np.asarray(x == y),
}

_CALLS: Mapping[str, Callable[..., Column]] = {
    "min": lambda *values: _fold(np.minimum, *values),
    "max": lambda *values: _fold(np.maximum, *values),
    "floor": lambda x: x if _integers(x) else _whole(np.floor(x)),
    "ceil": lambda x: x if _integers(x) else _whole(np.ceil(x)),
    "round": lambda x: x if _integers(x) else _whole(np.floor(x + 0.5)),
    "pow": _power,
    "mod": _modulo,
    "log": _logarithm,
}
