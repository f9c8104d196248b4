"""Expected results: comments `// RESULT: 1/6` above a property, compared with its result.

The convention is PRISM's. `RESULT (N=2,p=0.5): 0.25` holds for these values of constants only; the
first line whose constants match is used. A value ends at the first blank. `?` means unknown,
`Error…` an error or a refusal of any wording, and a leading `~` that a number is approximate even
if arithmetic is exact.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from enum import Enum
from fractions import Fraction
from math import isfinite, isnan
from typing import assert_never

from symcheck.check.result import Number, Result, Statistical, show_value
from symcheck.errors import InternalError, ResourceError, SymcheckError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import Value

__all__ = ["Verdict", "VerdictKind", "expected_value", "judge"]

_INTERVAL = re.compile(r"\[([^,]+),(.+)\]")
_LINE = re.compile(r"RESULT\s*(?:\((?P<constants>[^)]*)\))?\s*:\s*(?P<value>\S+)")
_ABSOLUTE = 1e-12
_RELATIVE = 1e-5


class VerdictKind(Enum):
    """The kinds of verdicts. `UNSUPPORTED` counts as a failure."""

    PASS = "PASS"
    FAIL = "FAIL"
    UNSUPPORTED = "UNSUPPORTED"
    NOT_TESTED = "NOT TESTED"


@dataclass(frozen=True, slots=True)
class Verdict:
    """A verdict; its text follows `Testing result: ` in the output."""

    kind: VerdictKind
    message: str = ""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.message}" if self.message else self.kind.value


@dataclass(frozen=True, slots=True)
class _Unequal(Exception):
    """The result differs from the expected one; the message says how."""

    message: str


def expected_value(comments: Sequence[str], constants: Mapping[str, Value]) -> str | None:
    """The text of the first RESULT line whose constants match; None if there is none."""
    for comment in comments:
        line = _LINE.search(comment)
        if line is not None and _fits(line["constants"], constants):
            return line["value"]
    return None


def _fits(condition: str | None, constants: Mapping[str, Value]) -> bool:
    if condition is None or not condition.strip():
        return True
    pairs = [part.split("=", 1) for part in condition.split(",")]
    return all(
        len(p) == 2 and p[0].strip() in constants and _same(p[1].strip(), constants[p[0].strip()])
        for p in pairs
    )


def _same(text: str, value: Value) -> bool:
    """Whether a text denotes a value: ints and bools are compared as texts, doubles as numbers."""
    if isinstance(value, bool):
        return text == str(value).lower()
    if isinstance(value, int):
        return text == str(value)
    try:
        return _number(text, {}) == value or float(_number(text, {})) == float(value)
    except _Unequal:
        return False


def judge(
    comments: Sequence[str],
    outcome: Result | Exception,
    constants: Mapping[str, Value],
    *,
    exact: bool = False,
) -> Verdict:
    """Compare the result of a property with the RESULT lines above it.

    Args:
        comments: the comments above the property.
        outcome: the result, or the error that was raised instead.
        constants: all known constants, of the model and the properties.
        exact: arithmetic was rational: numbers must be equal.
    """
    expected = expected_value(comments, constants)
    if expected is None:
        others = any(_LINE.search(comment) for comment in comments)
        which = "no RESULT line has these constants" if others else "no RESULT line"
        error = "an error, and " if isinstance(outcome, Exception) else ""
        return Verdict(VerdictKind.NOT_TESTED, error + which)
    if expected == "?":
        return Verdict(VerdictKind.NOT_TESTED, "the expected result is unknown")
    wants_error = expected.startswith("Error")
    if isinstance(outcome, Exception):
        # A defect or a limit says nothing about the property.
        fault = isinstance(outcome, SymcheckError)
        if wants_error and fault and not isinstance(outcome, InternalError | ResourceError):
            return Verdict(VerdictKind.PASS)
        refused = isinstance(outcome, UnsupportedError)
        kind = VerdictKind.UNSUPPORTED if refused else VerdictKind.FAIL
        return Verdict(kind, _one_line(outcome))
    if isinstance(outcome.accuracy, Statistical):
        return Verdict(VerdictKind.NOT_TESTED, "the result is an estimate")
    try:
        if wants_error:
            shown = show_value(outcome.value)
            raise _Unequal(f"an error was expected, but the result is {shown}")
        _compare(expected, outcome, constants, exact)
    except _Unequal as unequal:
        return Verdict(VerdictKind.FAIL, unequal.message)
    return Verdict(VerdictKind.PASS)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _compare(expected: str, result: Result, constants: Mapping[str, Value], exact: bool) -> None:
    """Raise _Unequal unless the result is as expected."""
    value = result.value
    approximate = expected.startswith("~")
    text = expected.removeprefix("~")
    tolerance = (
        0.0
        if exact and not approximate
        else _ABSOLUTE
        if result.by_steps and not approximate
        else _RELATIVE
    )
    match value:
        case None:
            raise _Unequal(f"the result is no single value, and {expected} was expected")
        case bool():
            if _truth(text, constants) is not value:
                raise _Unequal(f"{text} was expected, and the result is {show_value(value)}")
        case tuple():
            parts = _INTERVAL.fullmatch(text)
            if parts is None:
                raise _Unequal(
                    f"{text} was expected, and the result is the interval {show_value(value)}"
                )
            for part, end in zip(parts.groups(), value, strict=True):
                _compare_number(_number(part, constants), end, tolerance)
        case list():
            _compare_points(text, value, constants)
        case int() | float() | Fraction() if parts := _INTERVAL.fullmatch(text):
            low, high = (_number(part, constants) for part in parts.groups())
            if not low <= value <= high:
                _compare_number(low if value < low else high, value, tolerance)
        case int() | float() | Fraction():
            _compare_number(_number(text, constants), value, tolerance)
        case RationalFunction():
            from symcheck.engines.parametric.functions import function_of_text

            if function_of_text(text, value.field, constants) != value:
                raise _Unequal(f"{text} was expected, and the result is {value}")
        case _:
            assert_never(value)


def _compare_number(expected: Number, value: Number, tolerance: float) -> None:
    """Raise _Unequal unless two numbers are close.

    tolerance: 0 for equality, _ABSOLUTE, or _RELATIVE (to which _ABSOLUTE is added).
    """
    if expected == value or (isnan(expected) and isnan(value)):
        return
    message = f"{_show(expected)} was expected, and the result is {_show(value)}"
    difference = abs(float(value) - float(expected))
    whole = isinstance(value, int) and float(expected).is_integer()
    if tolerance == 0.0 or whole or not isfinite(difference):
        raise _Unequal(message)
    relative = tolerance * abs(float(value)) if tolerance == _RELATIVE else 0.0
    if difference > relative + _ABSOLUTE:
        raise _Unequal(f"{message}: they differ by {difference:.2g}")


def _compare_points(
    text: str, points: list[tuple[Number, ...]], constants: Mapping[str, Value]
) -> None:
    expected = [
        [_number(x, constants) for x in point.split(",")]
        for point in re.findall(r"\(([^()]+)\)", text)
    ]
    message = f"{text} was expected, and the result is {show_value(points)}"
    if sorted(map(len, expected)) != sorted(map(len, points)):
        raise _Unequal(message)
    left = list(points)
    for numbers in expected:
        near = [
            p
            for p in left
            if all(abs(float(x - y)) <= _RELATIVE for x, y in zip(p, numbers, strict=True))
        ]
        if not near:
            raise _Unequal(message)
        left.remove(near[0])


def _truth(text: str, constants: Mapping[str, Value]) -> bool:
    if text in ("true", "false"):
        return text == "true"
    value = _expression(text, constants)
    if not isinstance(value, bool):
        raise _Unequal(f"{text} was expected, and the result is a truth value")
    return value


def _number(text: str, constants: Mapping[str, Value]) -> Number:
    """The number of a text: special value, fraction, decimal, or expression over constants."""
    for kind in (Fraction, float):  # float: NaN and infinities
        try:
            return kind(text)
        except (ValueError, ZeroDivisionError):
            pass
    value = _expression(text, constants)
    if isinstance(value, bool):
        raise _Unequal(f"{text} was expected, and the result is a number")
    return value


def _expression(text: str, constants: Mapping[str, Value]) -> Value:
    from symcheck.syntax.parse import parse_expression

    known = {
        n: Fraction(repr(v)) if isinstance(v, float) and v - v == 0 else v
        for n, v in constants.items()
    }
    try:
        expression = parse_expression(text)
        try:
            return evaluate(expression, known, exact=True)
        except SymcheckError:
            return evaluate(expression, constants)  # irrational: a power, a logarithm
    except SymcheckError as error:
        raise _Unequal(f"the expected value {text} cannot be read: {_one_line(error)}") from None


def _show(value: Number) -> str:
    return show_value(
        float(value) if isinstance(value, Fraction) and value.denominator > 10**12 else value
    )
