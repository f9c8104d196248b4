"""Horizons far beyond the steps that can be made, on every engine: a run ends, with bounds that hold.

The oracles are closed forms. Work is counted in steps, which the log of a result has.
"""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

import symcheck
from symcheck.check.result import Result
from symcheck.errors import SymcheckError

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
ABSORBED = """ctmc
module m
  x : [0..1] init 0;
  [] x=0 -> 7:(x'=1);
endmodule
rewards x=0 : 1; endrewards
"""
STIFF = """ctmc
module m
  x : [0..8] init 0;
  [] x<8 & mod(x,2)=0 -> 1e6:(x'=x+1);
  [] x<8 & mod(x,2)=1 -> 1e-5:(x'=x+1) + 1e6:(x'=x-1);
endmodule
"""
NEARLY_DECOMPOSABLE = """{kind}
const double e = 1/1099511627776;
module m
  x : [0..2] init 0;
  [] x=0 -> 1/2:(x'=1) + (1/2-e):(x'=0) + e:(x'=2);
  [] x=1 -> 1/2:(x'=0) + (1/2-e):(x'=1) + e:(x'=2);
endmodule
rewards x<2 : 1; endrewards
"""
"""Each step is the last with the probability 2^-40."""


def holds(result: Result, exact: float, width: float = 1e-6) -> bool:
    """Whether the bounds contain the value and are close."""
    accuracy = result.accuracy
    lower = getattr(accuracy, "lower", result.value)
    upper = getattr(accuracy, "upper", result.value)
    room = 1e-12 * abs(exact)
    return bool(lower - room <= exact <= upper + room and upper - lower <= width * upper + 1e-299)


def steps_of(result: Result) -> int:
    return sum(run.iterations for run in result.runs)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("time", ["1e6", "1e9", "1e13", "1e300"])
def test_a_time_bound_after_all_is_absorbed(engine: str, time: str) -> None:
    model = symcheck.loads(ABSORBED).with_options(engine=engine)
    for query, exact in (
        (f"P=? [ F<={time} x=1 ]", 1.0),
        (f"P=? [ F[1,{time}] x=1 ]", 1.0),
        (f"P=? [ G<={time} x=0 ]", 0.0),
        (f"R=? [ C<={time} ]", 1 / 7),
        (f"R=? [ I={time} ]", 0.0),
    ):
        result = model.check(query)
        assert holds(result, exact), (query, result)
        assert steps_of(result) <= 3000


@pytest.mark.parametrize("engine", ENGINES)
def test_stiff_chains_take_as_few_steps_on_every_engine(engine: str) -> None:
    """The odd states are left forwards with the probability 1e-11: in 10 time units, 5 million times."""
    result = symcheck.loads(STIFF).with_options(engine=engine).check("P=? [ F<=10 x=8 ]")
    assert holds(result, 2.6040604189156805e-19, 1e-9)  # e^(Q t) in balls of 200 digits
    assert steps_of(result) <= 100


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("steps", [10**6, 10**12, 2**63 - 1])
def test_nearly_decomposable_chains(kind: str, engine: str, steps: int) -> None:
    model = symcheck.loads(NEARLY_DECOMPOSABLE.format(kind=kind)).with_options(engine=engine)
    best = "" if kind == "dtmc" else "max"
    stays = steps * math.log1p(-(2.0**-40))
    for query, exact in (
        (f"P{best}=? [ F<={steps} x=2 ]", -math.expm1(stays)),
        (f"P{best}=? [ G<={steps} x<2 ]", math.exp(stays)),
        (f"R{best}=? [ C<={steps} ]", -math.expm1(stays) * 2.0**40),
        (f"R{best}=? [ I={steps} ]", math.exp(stays)),
    ):
        result = model.check(query)
        assert holds(result, exact), (query, result)
        assert steps_of(result) <= 2000


SLOW_WALK = """{kind}
module m
  x : [0..399] init 399;
  [] x>0 -> 1/2:(x'=x-1) + 1/2:(x'=min(399,x+1));
  {lazy}
endmodule
"""
"""The target x=0 is some 160 000 steps away; 400 states are too many to square their matrix."""
LAZY = "[] x>0 -> 1/4:(x'=x-1) + 1/4:(x'=min(399,x+1)) + 1/2:true;"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("kind", "lazy"), [("dtmc", ""), ("mdp", LAZY)], ids=["dtmc", "mdp"])
def test_a_walk_reaches_its_target_in_far_more_steps_than_are_made(
    engine: str, kind: str, lazy: str
) -> None:
    """Not reached after 10^12 steps: cos(pi / 801)^(10^12), in the slowest of the modes."""
    model = symcheck.loads(SLOW_WALK.format(kind=kind, lazy=lazy)).with_options(engine=engine)
    for best in ("min", "max") if lazy else ("",):
        reached = model.check(f"P{best}=? [ F<={10**12} x=0 ]")
        assert holds(reached, 1.0), reached
        assert steps_of(reached) <= 20_000
        missed = model.check(f"P{best}=? [ G<={10**12} x>0 ]")
        assert 0.0 <= missed.bounds[0] <= missed.bounds[1] <= 1e-6, missed


@pytest.mark.parametrize("engine", ENGINES)
def test_a_small_value_far_below_the_one_without_a_bound(engine: str) -> None:
    """10^-16 at once, and hardly more after 10^12 steps, although 1 in the end: a distance from 1
    that is rounded would give 1.1e-16 as a lower bound.
    """
    text = """mdp
    module m
      x : [0..2] init 0;
      [] x=0 -> 1/10000000000000000:(x'=2) + 1-1/10000000000000000:(x'=1);
      [] x=1 -> 1/1099511627776/1099511627776/1099511627776/1099511627776:(x'=2)
              + 1-1/1099511627776/1099511627776/1099511627776/1099511627776:true;
      [] x=1 -> true;
    endmodule
    """
    model = symcheck.loads(text).with_options(engine=engine)
    jump, later = Fraction(1, 10**16), Fraction(10**12 - 1, 2**160)
    low, high = model.check(f"Pmax=? [ F<={10**12} x=2 ]").bounds
    assert low <= jump + later
    assert high >= jump
    low, high = model.check(f"Pmin=? [ G<={10**12} x<2 ]").bounds
    assert low <= 1 - jump
    assert high >= 1 - jump - later


def test_the_distribution_after_1e12_steps() -> None:
    model = symcheck.loads(NEARLY_DECOMPOSABLE.format(kind="dtmc"))
    found = model.transient(10**12)
    exact = -math.expm1(10**12 * math.log1p(-(2.0**-40)))
    assert found.lower[2] <= exact * (1 + 1e-12)
    assert found.upper[2] >= exact * (1 - 1e-12)
    assert found.error <= 1e-9


SLOW_MDP = """mdp
module m
  x : [0..2] init 0;
  [] x=0 -> {p}:(x'=1) + {q}:(x'=0);
  [] x=0 -> {p}/2:(x'=1) + 1-{p}/2:(x'=0);
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_an_mdp_ends_once_the_value_without_a_bound_is_reached(engine: str) -> None:
    text = SLOW_MDP.format(p="1/1024", q="1023/1024")
    model = symcheck.loads(text).with_options(engine=engine)
    for best in ("max", "min"):
        result = model.check(f"P{best}=? [ F<=1000000000000 x=1 ]")
        assert holds(result, 1.0), result
        assert steps_of(result) < 200_000


def test_an_mdp_that_is_too_slow_ends_with_wide_bounds_and_a_warning() -> None:
    text = SLOW_MDP.format(p="1e-12", q="1-1e-12")
    result = symcheck.loads(text).check("Pmax=? [ F<=1000000000000 x=1 ]")
    exact = -math.expm1(10**12 * math.log1p(-1e-12))
    assert result.accuracy.lower <= exact <= result.accuracy.upper
    assert any("steps were made" in warning for warning in result.warnings)


def test_exact_values_of_too_many_digits_are_refused() -> None:
    text = NEARLY_DECOMPOSABLE.format(kind="dtmc")
    model = symcheck.loads(text).with_options(exact=True)
    with pytest.raises(SymcheckError, match="fraction of about"):
        model.check("P=? [ F<=1000000000000 x=2 ]")


def test_rounded_values_that_no_longer_change_are_not_called_exact() -> None:
    """A reward of 1/2 + 2^-61 per step: doubles stay at 1/2 for ever, and the true value does not."""
    text = """dtmc
module m
  x : [0..400] init 0;
  [] x=0 -> 1-pow(2,-60.0):(x'=0) + pow(2,-60.0):(x'=1);
  [] x>0 & x<400 -> (x'=x+1);
  [] x=400 -> true;
endmodule
rewards x=0 : 1/2; x=400 : 1; endrewards
"""
    steps = 2**60
    result = symcheck.loads(text).check(f"R=? [ I={steps} ]")
    p = Fraction(1, 2**60)
    left = math.exp(steps * math.log1p(-float(p)))
    exact = 0.5 * left + (1 - left)
    assert getattr(result.accuracy, "lower", result.value) <= exact
    assert exact <= getattr(result.accuracy, "upper", result.value)


SIGNED = """{kind}
module m
  x : [0..1] init 0;
  [] x=0 -> 0.3:(x'=1) + 0.7:(x'=0);
  [] x=1 -> 0.4:(x'=0) + 0.6:(x'=1);
{more}endmodule
rewards "signed" x=0 : 1; x=1 : -2; endrewards
rewards "positive" x=0 : 1; endrewards
"""
"""The probability of x=1 after i steps is 3/7 (1 - 0.3^i)."""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("more", ["", "  [] x=1 -> 0.4:(x'=0) + 0.6:(x'=1);\n"])
def test_rewards_of_both_signs_over_long_horizons(engine: str, more: str) -> None:
    kind, best = ("mdp", "max") if more else ("dtmc", "")
    model = symcheck.loads(SIGNED.format(kind=kind, more=more)).with_options(engine=engine)
    for formula, exact in (
        ("C<=1000000000000", Fraction(-2 * 10**12, 7) + Fraction(90, 49)),
        ("I=1000000000000", Fraction(-2, 7)),
    ):
        result = model.check(f'R{{"signed"}}{best}=? [ {formula} ]')
        lower = Fraction(getattr(result.accuracy, "lower", result.value))
        upper = Fraction(getattr(result.accuracy, "upper", result.value))
        room = Fraction(1, 10**12) * abs(exact)
        assert lower - room <= exact <= upper + room
        assert upper - lower <= Fraction(1, 10**6) * abs(exact)
        assert steps_of(result) < 10_000


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("name", "other"), [("signed", -2), ("positive", 0)])
@pytest.mark.parametrize("digits", ["0.999999", "0.99999999999"])
def test_discounted_rewards_over_long_horizons(
    engine: str, name: str, other: int, digits: str
) -> None:
    """They need as many steps as the chain to mix, not as the discount to vanish."""
    model = symcheck.loads(SIGNED.format(kind="dtmc", more="")).with_options(engine=engine)
    result = model.check(f'R{{"{name}"}}=? [ C<=1000000000000000 discount={digits} ]')
    d, slope = Fraction(digits), Fraction(3 * (1 - other), 7)
    exact = (1 - slope) / (1 - d) + slope / (1 - Fraction(3, 10) * d)  # d^(10^15) vanishes
    lower, upper = result.accuracy.lower, result.accuracy.upper
    assert lower <= exact <= upper
    assert upper - lower <= 1e-6 * abs(exact)
    assert steps_of(result) < 10_000
