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
    with pytest.raises(UnsupportedError, match=r"rates from 1e-300 to 1e\+200") as refused:
        model.check(formula)
    # What is bounded in time has no rational value.
    assert refused.value.hint == (None if "<=1" in formula else "use -exact")


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


RARELY_LEFT = """
    s : [0..2] init 0;
    [] s=0 -> 1-1e-200 : true + 1e-200 : (s'=2);
    [] s=1 -> (s'=2);
    [] s=2 -> 1-1e-200 : true + 1e-200 : (s'=1);
endmodule
rewards s=1 : -2; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_a_tiny_average_of_a_state_that_is_left_at_last(engine: str, kind: str) -> None:
    """From 0, the average of states 1 and 2, although 1e-200 * 1e-200 is no double."""
    model = symcheck.loads(f"{kind} module m {RARELY_LEFT}", engine=engine)
    best = "max" if kind == "mdp" else ""
    for query, value in ((f"S{best}=? [ s=1 ]", "1e-200"), (f"R{best}=? [ S ]", "-2e-200")):
        lower, upper = model.check(query).bounds
        assert lower <= Fraction(value) <= upper
        assert upper - lower <= 1e-210


@pytest.mark.parametrize("engine", ENGINES)
def test_an_average_that_underflows_beside_another_is_bounded(engine: str) -> None:
    """State 3, of average 1, keeps the values from being scaled; 4 has 1e-400."""
    states = RARELY_LEFT.replace("2] init 0", "5] init 4").replace(
        "endmodule", "[] s=3 -> true; [] s=5 -> true; [] s=4 -> 1e-200:(s'=2) + 1:(s'=5); endmodule"
    )
    lower, upper = (
        symcheck.loads(f"dtmc module m {states}", engine=engine)
        .check("filter(max, S=? [ s=1 | s=3 ], s=4)")
        .bounds
    )
    assert lower == 0
    assert 0 < upper <= 1e-300


WALK = """
module walk
  n : [0..1003] init 3;
  [] 0<n & n<1003 -> 0.7 : (n'=n+1) + 0.3 : (n'=n-1);
  [] n=0 | n=1003 -> true;
endmodule
"""
OTHER_STEP = "[] 0<n & n<1003 -> 0.6 : (n'=n+1) + 0.4 : (n'=n-1);\nendmodule"


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_values_far_away_that_underflow_do_not_spoil_the_one_asked_for(engine: str) -> None:
    """At 1002, ruin has about the probability (3/7)^1002, which is no double."""

    def ruin(down: Fraction, n: int) -> Fraction:
        odds = down / (1 - down)
        return (odds**n - odds**1003) / (1 - odds**1003)

    low, high = ruin(Fraction(3, 10), 3), ruin(Fraction(4, 10), 3)
    asked = [
        (f"dtmc {WALK}", "P=? [ F n=0 ]", low),
        (f"mdp {WALK.replace('endmodule', OTHER_STEP)}", "Pmax=? [ F n=0 ]", high),
        (f"mdp {WALK.replace('endmodule', OTHER_STEP)}", "Pmin=? [ F n=0 ]", low),
    ]
    for text, query, value in asked:
        result = symcheck.loads(text, engine=engine).check(query)
        lower, upper = result.bounds
        assert lower <= value <= upper <= value * (1 + Fraction(1, 10**6))
        assert result.warnings == ()
    far = symcheck.loads(f"dtmc {WALK}", engine=engine).check(
        "filter(state, P=? [ F n=0 ], n=1002)"
    )
    assert far.bounds[0] == 0
    assert 0 < far.bounds[1] < 1e-270
    assert "further than asked for" in far.warnings[0]
