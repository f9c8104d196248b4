"""Rational arithmetic from the text of a model to the values of its properties."""

from __future__ import annotations

from fractions import Fraction

import pytest

from symcheck.api.loading import loads

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


COINS = """
dtmc
module coins
  heads : [0..3] init 0;
  tails : [0..3] init 0;
  [] heads<3 & tails<3 -> 1/3 : (heads'=heads+1) + 2/3 : (tails'=tails+1);
endmodule
rewards "heads"
  heads<3 & tails<3 : 1/2;
endrewards
rewards "tosses"
  heads<3 & tails<3 : 1;
endrewards
"""


def test_several_bounds_from_below_have_exact_values() -> None:
    value = loads(COINS, exact=True).check(
        'P=? [ F^{rew{"heads"}>=2, rew{"tosses"}>=4} heads+tails>=4 ]'
    )
    # Four tosses are made unless the first three are alike.
    assert value.value == 1 - Fraction(1, 27) - Fraction(8, 27)


def test_a_product_with_an_automaton_has_rational_entries() -> None:
    model = loads(COINS, exact=True)
    value = model.check("P=? [ (F heads=2) & (G tails<2) ]").value
    # At most one tail before the third head: three heads in a row, or one tail among the first
    # three tosses.
    assert value == Fraction(1, 27) + 3 * Fraction(2, 81)


def test_doubles_are_not_taken_for_rationals() -> None:
    engine = loads(COINS, exact=True).engine
    system = engine.system(engine.all)
    with pytest.raises(AssertionError, match="float"):
        system.lift(0.5 * system.full(1), None)


def test_bisimulation_is_not_used() -> None:
    result = loads(COINS, exact=True, bisim=True).check("P=? [ F heads=3 ]")
    assert result.value == Fraction(17, 81)
    assert any("rationals" in line for line in result.warnings)
