"""The bounds of a value that is exact up to rounding enclose the value that the text denotes."""

from __future__ import annotations

from fractions import Fraction
from math import ulp

import pytest

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.experiments.rows import Row
from symcheck.options import EngineName

ENGINES: tuple[EngineName, ...] = ("auto", "explicit", "sparse", "hybrid", "mtbdd")

DTMC = """dtmc
module m
  x : [0..4];
  [a] x=0 -> 0.1:(x'=1) + 0.2:(x'=2) + 0.7:(x'=0);
  [] x=1 -> 1/3:(x'=0) + 1/7:(x'=3) + 11/21:(x'=4);
  [] x=2 -> 1-0.9:(x'=1) + 0.9:(x'=4);
  [] x>2 -> true;
endmodule
module n
  y : [0..2];
  [a] y<2 -> 0.3:(y'=y+1) + 0.7:true;
  [a] y=2 -> true;
endmodule
rewards "r" x=0 : 0.1; x=1 : 1/3; [a] true : 0.7; endrewards
"""
CTMC = DTMC.replace("dtmc", "ctmc")
MDP = DTMC.replace("dtmc", "mdp").replace("[] x>2", "[b] x=1 -> 0.6:(x'=0) + 0.4:(x'=3);\n  [] x>2")
PROPERTIES = (
    "P=? [ F x=3 ]",
    "P=? [ x<2 U x=3 ]",
    "P=? [ X x=1 ]",
    "1 - P=? [ F x=3 ]",
    "P=? [ F x=3 ] - P=? [ F x=3 & y=2 ]",
    "P=? [ F x=3 ] / (P=? [ F y=2 ] * 3)",
    "P=? [ F x=3 || F y=2 ]",
    'R{"r"}=? [ F x>2 ]',
    "S=? [ x=3 ]",
    'R{"r"}=? [ S ]',
    "filter(sum, P=? [ F x=3 ])",
    "filter(avg, P=? [ F x=3 ], x<3)",
    "filter(min, P=? [ F x=3 ], x<3)",
    "filter(max, P=? [ F x=3 ], x<3)",
    "filter(range, P=? [ F x=3 ], x<3)",
    "0.1 + 0.2",
)
STEPS = ("P=? [ F<=7 x=3 ]", "P=? [ F[2,9] x=3 ]", 'R{"r"}=? [ C<=9 ]', 'R{"r"}=? [ I=3 ]')


def holds(text: str, formula: str, engine: EngineName) -> None:
    """The bounds contain the exact value, and are close."""
    truth = symcheck.loads(text, exact=True).check(formula).value
    least, most = truth if isinstance(truth, tuple) else (truth, truth)
    result = symcheck.loads(text, engine=engine).check(formula)
    lower, upper = result.bounds
    assert Fraction(lower) <= least <= most <= Fraction(upper), (result, least, most)
    width = 2e-6 if isinstance(result.accuracy, Certified) else 1e-9
    assert upper - lower - (most - least) <= width * abs(upper)
    shown = Row("", {}, result.value, result.accuracy).bounds
    assert shown is not None
    assert Fraction(shown[0]) <= least <= most <= Fraction(shown[1])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("formula", [*PROPERTIES, *STEPS])
def test_of_a_dtmc(formula: str, engine: EngineName) -> None:
    holds(DTMC, formula, engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("formula", PROPERTIES)
def test_of_a_ctmc(formula: str, engine: EngineName) -> None:
    holds(CTMC, formula, engine)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("best", ["min", "max"])
@pytest.mark.parametrize(
    "formula",
    ["P=? [ F x=3 ]", 'R{"r"}=? [ F x>2 ]', "P=? [ F<=7 x=3 ]", "S=? [ x=3 ]", 'R{"r"}=? [ S ]'],
)
def test_of_an_mdp(formula: str, best: str, engine: EngineName) -> None:
    holds(MDP, formula.replace("=?", f"{best}=?", 1), engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sixth_lies_strictly_between_close_bounds(engine: EngineName) -> None:
    result = symcheck.load("models/die/die.pm", engine=engine).check("P=? [ F d=6 ]")
    lower, upper = result.bounds
    assert result.accuracy == Exact(rounding=True)
    assert lower < Fraction(1, 6) < upper
    assert upper - lower < 500 * ulp(1 / 6)
    assert result.values.lower[0] == lower
    assert result.values.upper[0] == upper


def test_what_the_graph_or_rationals_know_has_no_width() -> None:
    die = symcheck.load("models/die/die.pm")
    assert die.check("P=? [ F s=7 ]").bounds == (1.0, 1.0)
    assert die.check("P=? [ F s=9 ]").bounds == (0.0, 0.0)
    assert die.check('R{"tosses"}=? [ F s=9 ]').accuracy == Exact()
    exact = die.with_options(exact=True).check("P=? [ F d=6 ]")
    assert exact.bounds == (Fraction(1, 6), Fraction(1, 6))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_threshold_between_the_bounds_is_refined(engine: EngineName) -> None:
    model = symcheck.loads(DTMC, engine=engine)
    truth = symcheck.loads(DTMC, exact=True).check("P=? [ F x=3 ]").value
    assert model.check(f"P>={truth} [ F x=3 ]").value is True
    assert model.check(f"P>{truth} [ F x=3 ]").value is False
