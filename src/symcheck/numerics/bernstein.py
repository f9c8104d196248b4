"""Bounds of polynomials and rational functions over boxes, in exact arithmetic.

The coefficients of a polynomial in the Bernstein basis of a box enclose its values there, and the
quotients of those of numerator and denominator enclose a rational function whose denominator has
one sign.
Sources: Garloff (1986), 'Convergent bounds for the range of multivariate polynomials'; Narkawicz,
Garloff, Smith & Muñoz (2012), 'Bounding the range of a rational function over a box'.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from functools import lru_cache
from math import comb, prod
from typing import Any

from symcheck.matrices.rational_functions import (
    FunctionField,
    Polynomial,
    RationalFunction,
    to_fraction,
)

__all__ = ["Box", "function_bounds", "sign_on"]

Box = Mapping[str, tuple[Fraction, Fraction]]
"""A closed interval of each parameter."""

_MOST_COEFFICIENTS = 30_000
"""Beyond this, coefficients are not computed: nothing is known about the polynomial."""


@lru_cache(maxsize=512)
def _basis(degree: int, low: Fraction, high: Fraction) -> Any:
    """The matrix from the coefficients of powers to those of the Bernstein basis of an interval.

    Row m has the blossom of each power at m times `high` and degree - m times `low`.
    """
    import flint

    a, b = (flint.fmpq(v.numerator, v.denominator) for v in (low, high))
    at_low, at_high = flint.fmpq_poly([1, a]), flint.fmpq_poly([1, b])
    rows = []
    for m in range(degree + 1):
        product = at_high**m * at_low ** (degree - m)
        rows.append([product[j] / comb(degree, j) for j in range(degree + 1)])
    return flint.fmpq_mat(rows)


def _coefficients(
    polynomial: Polynomial, degrees: tuple[int, ...], box: list[tuple[Fraction, Fraction]]
) -> list[Any] | None:
    """The coefficients in the Bernstein basis of some degrees; None if they are too many."""
    import flint

    size = prod(d + 1 for d in degrees)
    if size > _MOST_COEFFICIENTS:
        return None
    values: list[Any] = [flint.fmpq(0)] * size
    for exponents, value in polynomial.to_dict().items():
        at = 0
        for degree, exponent in zip(degrees, exponents, strict=True):
            at = at * (degree + 1) + int(exponent)
        values[at] = value
    # Each step transforms the first axis and makes it the last one.
    for degree, (low, high) in zip(degrees, box, strict=True):
        rest = size // (degree + 1)
        if degree:
            table = flint.fmpq_mat(degree + 1, rest, values)
            values = (_basis(degree, low, high) * table).transpose().entries()
        # An axis of degree 0 has one entry: its order does not matter.
    return values


def sign_on(parts: Iterable[Polynomial], field: FunctionField, box: Box) -> int | None:
    """The sign of a product of polynomials everywhere inside a box.

    Returns:
        1 or -1; 0 for a product that is 0; None if it is not known.
    """
    sign = 1
    for part in parts:
        bounds = function_bounds(RationalFunction(field, part, ()), box)
        if bounds is None or bounds[0] < 0 < bounds[1]:
            return None
        if bounds[0] == bounds[1] == 0:
            return 0
        sign *= 1 if bounds[1] > 0 else -1
    return sign


def function_bounds(function: RationalFunction, box: Box) -> tuple[Fraction, Fraction] | None:
    """Bounds of a function over a box; None if there are none, or they are not known."""
    field = function.field
    bottom = field.product(function.bottom)
    degrees = tuple(
        int(max(a, b)) for a, b in zip(function.top.degrees(), bottom.degrees(), strict=True)
    )
    ranges = [box[name] for name in field.names]
    above = _coefficients(function.top, degrees, ranges)
    if above is None:
        return None
    if not function.bottom:
        return to_fraction(min(above)), to_fraction(max(above))
    below = _coefficients(bottom, degrees, ranges)
    assert below is not None
    if not (min(below) > 0 or max(below) < 0):
        return None
    quotients = [a / b for a, b in zip(above, below, strict=True)]
    return to_fraction(min(quotients)), to_fraction(max(quotients))
