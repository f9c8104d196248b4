"""Real numbers known by enclosures: logarithms, and powers with fractional exponents.

Such a number has no fraction. It is kept as the function that encloses it to any number of digits,
and a comparison asks for more digits until the enclosures decide. Equal numbers are never decided:
then the comparison is a fault.

Source: Moore, Kearfott and Cloud (2009), Introduction to interval analysis; logarithm and
exponential are correctly rounded (Python's `decimal`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from decimal import (
    MAX_EMAX,
    MIN_EMIN,
    ROUND_CEILING,
    ROUND_FLOOR,
    Context,
    Decimal,
    DivisionByZero,
    InvalidOperation,
    Overflow,
)
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any, TypeVar

from symcheck.errors import Diagnostic, ModelFault

__all__ = ["Irrational", "Real", "exponential", "extreme", "logarithm"]

_DIGITS = (30, 120, 480)
_MOST_PLACES = 30
_BEYOND = Decimal(10) ** _MOST_PLACES  # no int of 64 bits, whatever the number is exactly
_REMEMBERED = 4096
"""Logarithms and exponentials that are remembered: few numbers occur in many expressions."""
_FAULTS = [InvalidOperation, DivisionByZero, Overflow]
Interval = tuple[Decimal, Decimal]
T = TypeVar("T")


def _down(digits: int) -> Context:
    return Context(digits, ROUND_FLOOR, MIN_EMIN, MAX_EMAX, traps=_FAULTS)


def _up(digits: int) -> Context:
    return Context(digits, ROUND_CEILING, MIN_EMIN, MAX_EMAX, traps=_FAULTS)


class Irrational:
    """A real number, finite and in general irrational.

    Args:
        enclose: gives an interval with about so many digits; it may raise `ArithmeticError` where
            these are too few.
        why: the diagnostic that this number has no exact value, with its place.
    """

    __slots__ = ("_compute", "_known", "why")

    def __init__(self, enclose: Callable[[int], Interval], why: Diagnostic) -> None:
        self._compute = enclose
        self._known: dict[int, Interval] = {}
        self.why = why

    def enclose(self, digits: int) -> Interval:
        """An interval with about so many digits, computed once: numbers share their operands."""
        if digits not in self._known:
            self._known[digits] = self._compute(digits)
        return self._known[digits]

    def __repr__(self) -> str:
        return f"Irrational({float(self)!r})"

    def _first(self, read: Callable[[Decimal, Decimal], T | None]) -> T:
        """What is read from the first interval that suffices; raises ModelFault if none does."""
        for digits in _DIGITS:
            try:
                low, high = self.enclose(digits)
            except ArithmeticError:
                continue
            answer = read(low, high)
            if answer is not None:
                return answer
        message = f"{_DIGITS[-1]} digits do not decide a condition on this number"
        hint = "write the condition without a logarithm or a fractional power"
        raise ModelFault(Diagnostic(message, self.why.span, "undecided", hint))

    def sign(self) -> int:
        """-1, 0 or 1. Raises ModelFault if enclosures do not decide."""
        return self._first(
            lambda low, high: 1 if low > 0 else -1 if high < 0 else 0 if low == high else None
        )

    def __floor__(self) -> int:
        def read(low: Decimal, high: Decimal) -> int | None:
            below, above = (
                math.floor(x) if x.adjusted() < _MOST_PLACES else int(_BEYOND.copy_sign(x))
                for x in (low, high)
            )
            return below if below == above else None

        return self._first(read)

    def __ceil__(self) -> int:
        return -math.floor(-self)

    def __float__(self) -> float:
        """The nearest double, or the one beside it; an infinity beyond the range of doubles.

        Raises ModelFault if enclosures do not tell these from others.
        """

        def read(low: Decimal, high: Decimal) -> float | None:
            below, above = float(low), float(high)
            return below if math.nextafter(below, math.inf) >= above else None

        return self._first(read)

    # ----------------------------------------------------------------------------------- arithmetic

    def __neg__(self) -> Irrational:
        def enclose(digits: int) -> Interval:
            low, high = self.enclose(digits)
            return high.copy_negate(), low.copy_negate()

        return Irrational(enclose, self.why)

    def __add__(self, other: Irrational | Fraction) -> Irrational:
        def enclose(digits: int) -> Interval:
            (a, b), (c, d) = self.enclose(digits), interval(other, digits)
            return _down(digits).add(a, c), _up(digits).add(b, d)

        return Irrational(enclose, self.why)

    def __mul__(self, other: Irrational | Fraction) -> Irrational | Fraction:
        if isinstance(other, Fraction) and other == 0:
            return other

        def enclose(digits: int) -> Interval:
            ends = list(product(self.enclose(digits), interval(other, digits)))
            down, up = _down(digits), _up(digits)
            return min(down.multiply(a, b) for a, b in ends), max(up.multiply(*e) for e in ends)

        return Irrational(enclose, self.why)

    def reciprocal(self) -> Irrational:
        """1 / x."""

        def enclose(digits: int) -> Interval:
            low, high = self.enclose(digits)
            if low <= 0 <= high:
                raise ArithmeticError
            return _down(digits).divide(Decimal(1), high), _up(digits).divide(Decimal(1), low)

        return Irrational(enclose, self.why)

    def __sub__(self, other: Irrational | Fraction) -> Irrational:
        return self + -other

    def __rsub__(self, other: Fraction) -> Irrational:
        return -self + other

    def __truediv__(self, other: Irrational | Fraction) -> Irrational | Fraction:
        return self * (1 / other if isinstance(other, Fraction) else other.reciprocal())

    def __rtruediv__(self, other: Fraction) -> Irrational | Fraction:
        return self.reciprocal() * other

    __radd__, __rmul__ = __add__, __mul__

    # ---------------------------------------------------------------------------------- comparisons

    def _order(self, other: object) -> int:
        """The sign of self - other. An infinity is beyond every number; NaN is not compared."""
        if isinstance(other, float) and math.isinf(other):
            return -1 if other > 0 else 1
        assert isinstance(other, Irrational | Fraction | int)
        return (self - (Fraction(other) if isinstance(other, int) else other)).sign()

    def __lt__(self, other: object) -> bool:
        return other == other and self._order(other) < 0

    def __le__(self, other: object) -> bool:
        return other == other and self._order(other) <= 0

    def __gt__(self, other: object) -> bool:
        return other == other and self._order(other) > 0

    def __ge__(self, other: object) -> bool:
        return other == other and self._order(other) >= 0

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return not (isinstance(other, float) and math.isnan(other)) and self._order(other) == 0

    __hash__ = object.__hash__


Real = Irrational | Fraction


def interval(x: Real, digits: int) -> Interval:
    """An interval of a number with so many digits."""
    if isinstance(x, Irrational):
        return x.enclose(digits)
    top, bottom = Decimal(x.numerator), Decimal(x.denominator)
    return _down(digits).divide(top, bottom), _up(digits).divide(top, bottom)


def logarithm(x: Real, why: Diagnostic) -> Irrational:
    """The natural logarithm of a positive number other than 1."""

    def enclose(digits: int) -> Interval:
        low, high = interval(x, digits)
        if low <= 0:
            raise ArithmeticError
        return _logarithm(low, digits)[0], _logarithm(high, digits)[1]

    return Irrational(enclose, why)


def extreme(a: Real, b: Real, better: Callable[[Any, Any], bool]) -> Real:
    """The better one of two numbers, the least or the greatest.

    Where few digits do not tell which one it is, that is never asked: the extremes of both
    enclosures enclose it, also where the numbers are equal.
    """

    def enclose(digits: int) -> Interval:
        (a, b), (c, d) = intervals(digits)
        return (a if better(a, c) else c), (b if better(b, d) else d)

    def intervals(digits: int) -> tuple[Interval, Interval]:
        return interval(a, digits), interval(b, digits)

    with suppress(ArithmeticError):
        of_a, of_b = intervals(_DIGITS[0])
        if all(better(x, y) for x, y in product(of_a, of_b)):
            return a
        if all(better(y, x) for x, y in product(of_a, of_b)):
            return b
    irrational = a if isinstance(a, Irrational) else b
    assert isinstance(irrational, Irrational)
    return Irrational(enclose, irrational.why)


@lru_cache(_REMEMBERED)
def _logarithm(x: Decimal, digits: int) -> Interval:
    """An interval of the logarithm of x > 0."""
    down, up = _down(digits), _up(digits)
    return down.next_minus(down.ln(x)), up.next_plus(up.ln(x))


def exponential(x: Real, why: Diagnostic) -> Irrational:
    """The exponential of a number other than 0."""

    def enclose(digits: int) -> Interval:
        low, high = interval(x, digits + _MOST_PLACES)
        return _exponential(low, digits)[0], _exponential(high, digits)[1]

    return Irrational(enclose, why)


@lru_cache(_REMEMBERED)
def _exponential(x: Decimal, digits: int) -> Interval:
    """An interval of the exponential of x, 10**k exp(x - k ln 10), as `exp` of much takes long."""
    if x.adjusted() > _MOST_PLACES:  # k has no room in an exponent, and may have billions of digits
        raise InvalidOperation
    down, up = _down(digits + _MOST_PLACES), _up(digits + _MOST_PLACES)
    ln = down.ln(Decimal(10))
    k = int(down.divide(x, ln))
    ends = down.next_minus(ln), up.next_plus(ln)
    low = down.subtract(x, max(up.multiply(end, k) for end in ends))
    high = up.subtract(x, min(down.multiply(end, k) for end in ends))
    return (
        down.scaleb(down.next_minus(down.exp(low)), k),
        up.scaleb(up.next_plus(up.exp(high)), k),
    )
