"""Bounds contain the exact value where single operations round it."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.check.result import Exact
from symcheck.options import EngineName

ENGINES: tuple[EngineName, ...] = ("explicit", "sparse", "hybrid", "mtbdd")
SHARED_STEPS = """dtmc
module m
  x : [0..1] init 1;
  [] y!=0 -> 2/3 : (x'=1-x) + 1/3 : (x'=0);
  [go] true -> (x'=0);
endmodule
module n
  y : [0..1] init 1;
  [] true -> (y'=1-y);
  [go] y=0 -> 0.5 : (y'=1) + 0.5 : (y'=0);
  [] true -> (y'=1-y);
endmodule
label "a" = x=0; label "b" = y=1;
"""
ABSORBED = """dtmc
module m
  x : [0..3];
  [] x=1 -> 1/3 : (x'=2) + 2/3 : true;
  [] x=2 -> 1/7 : (x'=1) + 6/7 : true;
  [go] x=3 -> true;
  [] x=3 -> true;
  [] x=3 -> true;
endmodule
init x>0 endinit
rewards [go] true : 1; x=3 : 0.5; x=2 : 1/3; endrewards
"""


def bounds(text: str, formula: str, **options: object) -> tuple[Fraction, Fraction, Fraction]:
    """The lower bound, the exact value and the upper bound."""
    result = symcheck.loads(text, **options).check(formula)  # type: ignore[arg-type]
    assert result.accuracy != Exact()
    exact = symcheck.loads(text, exact=True).check(formula).value
    exact = max(exact) if isinstance(exact, tuple) else exact
    assert isinstance(exact, Fraction)
    lower, upper = result.bounds
    return Fraction(lower), exact, Fraction(upper)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("least", range(1, 9))
def test_steps_before_bounds_are_rounded(engine: EngineName, least: int) -> None:
    formula = f'P=? [ "b" U>{least} ("a" & "b") ]'
    lower, exact, upper = bounds(SHARED_STEPS, formula, engine=engine, method="interval")
    assert lower <= exact <= upper


@pytest.mark.parametrize("engine", ENGINES)
def test_an_absorbing_state_beside_a_component_with_bounds(engine: EngineName) -> None:
    lower, exact, upper = bounds(ABSORBED, "R=? [ S ]", engine=engine)
    assert exact == Fraction(5, 6)
    assert lower <= exact <= upper
