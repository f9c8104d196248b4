"""Rational arithmetic from the text of a model to the values of its properties."""

from __future__ import annotations

from fractions import Fraction

import pytest

from symcheck.api import loads

TENTHS = """
dtmc
const double p = 0.1;
module m
  s : [0..2] init 0;
  [] s=0 -> p : (s'=1) + 1-p : (s'=2);
  [] s>0 -> true;
endmodule
"""


def test_decimals_are_the_fractions_they_are_written_as() -> None:
    assert loads(TENTHS, engine="exact").check("P=? [ F s=1 ]").value == Fraction(1, 10)
    assert loads(TENTHS, exact=True).check("P=? [ F s=1 ]").value == Fraction(1, 10)


def test_constants_that_are_given_are_fractions_too() -> None:
    model = loads(TENTHS.replace("p = 0.1", "p"), {"p": "0.3"}, engine="exact")
    assert model.check("P=? [ F s=1 ]").value == Fraction(3, 10)


def test_another_engine_can_be_taken_and_left_again() -> None:
    model = loads(TENTHS)
    exact = model.with_options(engine="exact")
    assert exact.check("P=? [ F s=1 ]").value == Fraction(1, 10)
    value = exact.with_options(engine="explicit").check("P=? [ F s=1 ]").value
    assert isinstance(value, float)
    assert value == pytest.approx(0.1)
