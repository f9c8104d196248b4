"""Probabilities near the end of the range of doubles are bounded, or refused with a hint; against
rationals.
"""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.errors import UnsupportedError

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
METHODS = ("auto", "interval", "optimistic", "topological")

MODEL = """
ctmc
const double slow;
const double fast;
module m
  s : [0..4] init 0;
  [] s=0 -> slow : (s'=1) + fast : (s'=2);
  [] s=1 -> slow : (s'=3) + fast : (s'=2);
  [] s=2 -> fast : (s'=4);
  [] s>2 -> 1 : true;
endmodule
"""
"""Two slow jumps in a row."""

LOOP = """
ctmc
module m
  s : [0..3] init 0;
  [] s=0 -> 1e-150 : (s'=1) + 1e-150 : (s'=3) + 1e150 : (s'=2);
  [] s=2 -> (s'=0);
  [] s=1 | s=3 -> true;
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_a_product_of_probabilities_that_underflows_is_bounded(engine: str, method: str) -> None:
    constants = "slow=1e-200,fast=1"
    model = symcheck.loads(MODEL, constants, engine=engine, method=method)
    result = model.check("P=? [F s=3]")
    exact = symcheck.loads(MODEL, constants, exact=True).check("P=? [F s=3]").value
    lower, upper = result.bounds
    assert lower <= exact <= upper <= 1e-306
    assert lower < upper, "a probability above 0 has an upper bound above 0"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("formula", ["P=? [F s=1]", "P=? [X s=1]", "S=? [s=1]", "P=? [F<=1 s=1]"])
def test_rates_too_far_apart_for_doubles_are_refused(engine: str, formula: str) -> None:
    model = symcheck.loads(MODEL, "slow=1e-300,fast=1e200", engine=engine)
    with pytest.raises(UnsupportedError, match=r"rates from 1e-300 to 1e\+200.*\n.*use -exact"):
        model.check(formula)


def test_probabilities_too_small_for_doubles_are_refused() -> None:
    text = "dtmc module m s:[0..1]; [] s=0 -> 1e-310:(s'=1) + 1:true; [] s=1 -> true; endmodule"
    with pytest.raises(UnsupportedError, match=r"probability 1e-310.*\n.*use -exact"):
        symcheck.loads(text).check("P=? [F<=3 s=1]")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_constant_that_underflow_has_blurred_is_not_called_exact(engine: str) -> None:
    result = symcheck.loads(LOOP, engine=engine).check("P=? [F s=1]")
    lower, upper = result.bounds
    assert lower <= 0.5 <= upper
    assert upper - lower <= 1e-12 or "certified" in str(result)


def test_small_rates_lose_no_digits() -> None:
    constants = "slow=1e-300,fast=1e-280"
    result = symcheck.loads(MODEL, constants, engine="explicit").check("P=? [F s=3]")
    exact = symcheck.loads(MODEL, constants, exact=True).check("P=? [F s=3]").value
    assert result.value == pytest.approx(float(exact), rel=1e-12)


JOINT = """
module m  s:[0..1] init 0; [a] s=0 -> 1e-200:(s'=1) + 1:true; [a] s=1 -> true; [] s=0 -> true; endmodule
module n  t:[0..1] init 0; [a] t=0 -> 1e-200:(t'=1) + 1:true; [a] t=1 -> true; endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp", "ctmc"])
def test_a_joint_step_whose_probability_underflows_is_not_lost(engine: str, kind: str) -> None:
    """Two choices at once halve it in a DTMC."""
    model = symcheck.loads(kind + JOINT, engine=engine)
    assert model.check("E [ F s=1&t=1 ]").value is True
    assert model.check("P>0 [ F s=1&t=1 ]").value is (kind != "mdp")
    with pytest.raises(UnsupportedError, match="too small for floating-point numbers"):
        model.check(f"P{'max' * (kind == 'mdp')}=? [F s=1&t=1]")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("rate", "reward"),
    [
        ("1e-200", "[b] true : 1e-200;"),
        ("1", "s=1 : 1e-310;"),
        ("1e200", "s=1 : 1e-200;"),
    ],
)
def test_a_reward_of_a_step_that_underflows_is_refused(engine: str, rate: str, reward: str) -> None:
    """It is not taken for none; the graph and other rewards are checked."""
    text = f"""ctmc
    module m  s:[0..2]; [] s=0 -> {rate}:(s'=1); [b] s=1 -> {rate}:(s'=2); [] s=2 -> true; endmodule
    rewards {reward} endrewards  rewards "other" s=1 : {rate}; endrewards
    """
    model = symcheck.loads(text, engine=engine)
    with pytest.raises(
        UnsupportedError, match=r"reward .* too small for floating-point.*\n.*-exact"
    ):
        model.check("R=? [ F s=2 ]")
    assert model.check('R{"other"}=? [ F s=2 ]').value == pytest.approx(1.0)
    exact = symcheck.loads(text, exact=True).check("R=? [ F s=2 ]").value
    assert isinstance(exact, Fraction)
    assert 0 < exact < Fraction("1e-199")
