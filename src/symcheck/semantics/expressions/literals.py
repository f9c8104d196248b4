"""Conversion of values between types, to literals, and to text."""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

from symcheck.errors import NO_SPAN, Span
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Binary, Expression, Literal, Type
from symcheck.syntax.operators import Operator
from symcheck.tables import plain_text

__all__ = [
    "LARGEST_WHOLE",
    "LEAST",
    "LEAST_NORMAL",
    "as_double",
    "as_expression",
    "convert",
    "format_state",
    "format_value",
    "to_float",
    "to_signed_float",
    "type_of_value",
]

LARGEST_WHOLE = 2**53
"""Up to this number, every int is a double."""
LEAST_NORMAL = 2.0**-1022
"""The least double whose relative error is that of larger ones."""
LEAST = 5e-324
"""The least positive double. A result below normal ones is wrong by at most half of it."""


def to_float(value: Value) -> float:
    """The nearest double; an infinity beyond the range of doubles (IEEE 754)."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def to_signed_float(value: Value) -> float:
    """The nearest double, but the least one with its sign where that is 0 and the number is not: an
    edge with a tiny probability stays one.
    """
    nearest = to_float(value)
    return (LEAST if value > 0 else -LEAST) if nearest == 0 and value != 0 else nearest


def type_of_value(value: Value) -> Type:
    """The type of a Python value: bool, int, or double for float and Fraction."""
    return (
        Type.BOOL
        if isinstance(value, bool)
        else Type.INT
        if isinstance(value, int)
        else Type.DOUBLE
    )


def convert(value: Value, expected: Type, exact: bool) -> Value:
    """Convert a value to type `wanted`.

    An int may become a double. A double is a Fraction in exact arithmetic, except infinities and
    NaN, and a float otherwise. Raises TypeError for any other conversion.
    """
    actual = type_of_value(value)
    if expected is Type.DOUBLE and actual is not Type.BOOL:
        if not exact:
            return to_signed_float(value)
        return value if isinstance(value, float) and not math.isfinite(value) else Fraction(value)
    if expected is not actual:
        raise TypeError(f"{format_value(value)} is of type {actual.value}, not {expected.value}")
    return value


def as_expression(value: Value, kind: Type, span: Span = NO_SPAN) -> Expression:
    """An expression of type `kind` that evaluates to exactly `value`.

    Literals hold fractions, so infinities and NaN become divisions by zero.
    """
    if kind is not Type.DOUBLE:
        assert not isinstance(value, float)
        return Literal(value, kind, span=span)
    zero = Literal(Fraction(0), kind, span=span)
    if isinstance(value, float):
        if not math.isfinite(value):
            top = 0 if math.isnan(value) else 1 if value > 0 else -1
            return Binary(Operator.DIVIDE, Literal(Fraction(top), kind, span=span), zero, span=span)
    # The shortest decimal that rounds to this float is easier to read than its exact binary value.
    return Literal(
        Fraction(repr(value)) if isinstance(value, float) else Fraction(value), kind, span=span
    )


def as_double(expression: Expression) -> Expression:
    """An expression of a number as one of type double, if it is a literal."""
    match expression:
        case Literal(int(value), Type.INT):
            return Literal(Fraction(value), Type.DOUBLE, span=expression.span)
        case _:
            return expression


def format_value(value: Value) -> str:
    """The text of a value: `true`, `3`, `0.1`, `1/3`, `Infinity`, `NaN`."""
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else plain_text(value)


def format_state(values: Iterable[Value]) -> str:
    """The text of a state: `(0,true)`."""
    return f"({','.join(map(format_value, values))})"
