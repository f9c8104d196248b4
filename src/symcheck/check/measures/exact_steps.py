"""Steps in rational arithmetic, in integers over a common denominator.

With u the common denominator of probabilities and rewards, the values after k steps are integers
over u^k. Reduced fractions have greatest common divisors in each product and sum instead, which
take seconds for some steps with numbers such as 1e-300.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from symcheck.check import tuning
from symcheck.check.measures.signed_steps import best
from symcheck.direction import Direction
from symcheck.engines.base import System
from symcheck.matrices.numbers import Numbers, is_infinite, rationals

__all__ = ["steps_in_integers"]


def steps_in_integers(
    system: System,
    x: Numbers,
    add: Numbers,
    steps: int,
    direction: Direction | None,
    factor: Fraction | int = 1,
) -> Numbers | None:
    """The values after some steps x' = add + factor A x, best over the rows of each state.

    Args:
        system: rational equations.
        x: the values before, per state.
        add: what each step adds, per row; empty: nothing.
        steps: their number.
        direction: minimise or maximise; None for a chain.
        factor: of the later values.

    Returns:
        None if the denominators become too large, or a number is not finite: reduced fractions may
        be smaller.
    """
    if is_infinite(x).any() or is_infinite(add).any():
        return None
    matrix = system.matrix
    entries = rationals(factor * p for p in matrix.data)
    bits = tuning.INTEGER_BITS // max(steps, 1)
    unit, scale = _denominator([*entries, *add], bits), _denominator(x, tuning.INTEGER_BITS)
    if unit is None or scale is None:
        return None
    product = replace(matrix, data=_times(entries, unit))
    added, values = _times(add, unit), _times(x, scale)
    for taken in range(1, steps + 1):
        rows = product.multiply(values)
        if len(added):
            rows = rows + added * scale
        following = best(rows, system, direction)
        # Values that stay the same are noticed, at the price of a few comparisons.
        if taken & (taken - 1) == 0 and np.array_equal(following, values * unit):
            break
        values, scale = following, scale * unit
    return rationals(Fraction(int(v), scale) for v in values)


def _denominator(numbers: Iterable[Fraction], bits: int) -> int | None:
    """The least common denominator; None if it has more bits."""
    found = 1
    for number in numbers:
        found = math.lcm(found, number.denominator)
        if found.bit_length() > bits:
            return None
    return found


def _times(numbers: Numbers, factor: int) -> Numbers:
    """The integers that numbers are in multiples of 1 / factor."""
    out = np.empty(len(numbers), object)
    out[:] = [v.numerator * (factor // v.denominator) for v in numbers]
    return out
