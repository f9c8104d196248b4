"""Bounds are never answered wrongly: by graph, by more accuracy, by rational arithmetic, or not at all."""

from __future__ import annotations

import pytest

from checking import RESULTS, check_text, engine_of
from symcheck.check.result import Exact
from symcheck.engines.registry import BUILDERS
from symcheck.errors import NumericalError
from symcheck.numerics import rational_limits

DIE = (RESULTS / "die.pm").read_text()


@pytest.mark.parametrize("name", BUILDERS)
@pytest.mark.parametrize(
    ("formula", "true"),
    [
        ('P>=0.1666666 [ F "six" ]', True),
        ('P>=1/6 [ F "six" ]', True),
        ('P<=1/6 [ F "six" ]', True),
        ('P>1/6 [ F "six" ]', False),
        ('P<1/6 [ F "six" ]', False),
        ('P>=0.16666666666667 [ F "six" ]', False),
        ('P>0.16666666666666 [ F "six" ]', True),
        ('P=? [ F "six" ] = 1/6', True),
        ('P=? [ F "six" ] != 1/6', False),
        ("P=? [ F s=7&d=1 ] = P=? [ F s=7&d=4 ]", True),
        ("P=? [ F s=7&d=1 ] < P=? [ F s=7&d=4 ]", False),
        ('R{"tosses"}<=11/3 [ F "done" ]', True),
        ('R{"tosses"}<11/3 [ F "done" ]', False),
        ('R{"tosses"}=? [ F "done" ] * 3 = 11', True),
        ("S>=1/6 [ d=6 ]", True),
        ('filter(min, P=? [ F "six" ], s<7) >= 0', True),
        ('filter(forall, P<=1/3 [ F "six" ], s<6)', True),
        ('P>=1 [ F P>=1/6 [ F "six" ] ]', True),
        ('P>0.5 [ F<=4 "done" ]', True),
        ('P>0.75 [ F<=4 "done" ]', False),
        ('P>=0.75 [ F<=4 "done" ]', True),
    ],
)
def test_die(name, formula, true):
    assert check_text(engine_of(DIE, name), formula).value is true


def test_exactness_is_noted():
    result = check_text(engine_of(DIE), 'P>=1/6 [ F "six" ]')
    assert any("rational" in w for w in result.warnings)
    assert not check_text(engine_of(DIE), 'P>=0.1 [ F "six" ]').warnings


def test_refused_where_rationals_are_too_dear(monkeypatch):
    monkeypatch.setattr(rational_limits, "STATES", 5)
    engine = engine_of(DIE)
    with pytest.raises(NumericalError, match=r"for example in state \(s=0,d=0\)"):
        check_text(engine, 'P>=1/6 [ F "six" ]')
    # It does not matter that it is open at states that were not asked about.
    assert check_text(engine, 'filter(state, P>=1/6 [ F "six" ], s=2)').value is True


def test_refused_where_no_rational_value_exists():
    engine = engine_of("ctmc module m x:[0..1]; [] x=0 -> 1:(x'=1); endmodule")
    with pytest.raises(NumericalError, match="too close"):
        check_text(engine, "P=? [ F<=1 x=1 ] = P=? [ F<=1 x>0 ]")


def test_probabilities_of_zero_and_one_need_no_numbers():
    result = check_text(engine_of(DIE), 'P>=1 [ F "done" ]')
    assert result.value is True
    assert not result.runs


def test_rounding_in_a_long_sum_is_no_reason_for_a_wrong_answer():
    """Ten steps of probability 0.1 each: as doubles they do not add up to 1."""
    updates = " + ".join(f"0.1:(x'={i})" for i in range(1, 11))
    engine = engine_of(
        f"dtmc module m x:[0..11]; [] x=0 -> {updates}; [] x>0&x<11 -> 0.5:(x'=11)+0.5:(x'=0); [] x=11 -> true; endmodule"
    )
    assert check_text(engine, "P>=0.5 [ F<=2 x=11 ]").value is True
    assert check_text(engine, "P>0.5 [ F<=2 x=11 ]").value is False
    assert check_text(engine, "P>=1 [ X x>0 & x<11 ]").value is True


@pytest.mark.parametrize("engine", BUILDERS)
def test_a_whole_sum_of_rates_may_be_rounded(engine: str) -> None:
    text = """ctmc module m x : bool;
        [] true -> 1e12 : (x'=!x);
        [] true -> 1e-12 : (x'=!x);
        endmodule rewards [] true : 0.5; endrewards"""
    built = engine_of(text, engine)
    assert check_text(built, "R=? [ S ]").accuracy == Exact(rounding=not built.is_rational)
    assert check_text(built, "R>5e11 [ S ]").value is True


@pytest.mark.parametrize("method", ["interval", "optimistic"])
@pytest.mark.parametrize("engine", ["explicit", "hybrid"])
def test_a_complement_of_bounds_is_rounded_outwards(engine: str, method: str) -> None:
    text = """mdp module m x : [0..3] init 2;
        [] x=2 -> 1e-12 : (x'=3) + 1-1e-12 : (x'=1);
        [] x=1 | x=3 -> (x'=x-1);
        endmodule"""
    built = engine_of(text, engine)
    assert check_text(built, "Pmin<=0.999999999999 [ X X x<2 ]", method=method).value is True
    assert check_text(built, "Pmin<0.999999999999 [ X X x<2 ]", method=method).value is False
