"""What algorithms ask of weights: a field for elimination, an expectation for iteration."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from symcheck.direction import Direction
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import best_of_rows
from symcheck.numerics.linear.rational import least_solution


@pytest.mark.parametrize("number", [float, Fraction])
def test_elimination_takes_any_field(number):
    half = number(0.5)
    # a fair coin: again, or the end; then the same with a second state in between
    assert least_solution([{0: half}], [half]) == [1]
    assert least_solution([{1: half}, {0: half, 1: half / 2}], [half, half / 2]) == [1, 1]


class Rational:
    """A rational function of x: a field without an order. Coefficients are from x^0 on."""

    def __init__(self, above):
        self.above, self.below = np.poly1d(above[::-1]), np.poly1d([1])

    def at(self, x):
        return self.above(x) / self.below(x)

    @staticmethod
    def made(above, below):
        made = Rational((0,))
        made.above, made.below = above, below
        return made

    @staticmethod
    def of(value):
        return value if isinstance(value, Rational) else Rational((value,))

    def __bool__(self):
        return any(c != 0 for c in self.above.coeffs)

    def __add__(self, other):
        other = self.of(other)
        return self.made(
            self.above * other.below + other.above * self.below, self.below * other.below
        )

    __radd__ = __add__

    def __rsub__(self, other):
        return self * -1 + other

    def __mul__(self, other):
        other = self.of(other)
        return self.made(self.above * other.above, self.below * other.below)

    def __truediv__(self, other):
        return self * self.made(self.of(other).below, self.of(other).above)


def test_elimination_compares_no_elements():
    x = Rational((0, 1))
    # left with probability x, right with 1 - x; from the middle of three places to the right end
    rows = [{1: 1 - x}, {0: x}]
    found = least_solution(rows, [x * 0, 1 - x])
    assert found[1].at(0.25) == pytest.approx(0.75 / (1 - 0.25 * 0.75))


@pytest.mark.parametrize("kind", [np.asarray, rationals])
def test_the_best_of_rows(kind):
    values, groups = kind([3.0, 1.0, 2.0]), np.array([0, 2, 3])
    assert best_of_rows(values, groups, Direction.MIN).tolist() == [1, 2]
    assert best_of_rows(values, groups, Direction.MAX).tolist() == [3, 2]
    assert best_of_rows(values, None, None) is values
