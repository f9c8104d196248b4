"""Small probabilities of G, W and R keep their digits: they are not 1 minus what was computed."""

from __future__ import annotations

from math import exp
from random import Random

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model
from symcheck.errors import InputError, UnsupportedError

FORMULAS = (
    'G "a"',
    '"a" W "b"',
    '"a" R "b"',
    'G<=7 !"b"',
    '"a" W[2,5] "b"',
    '"a" R>=3 "b"',
    '!(X "a")',
    '!("a" U<=4 "b")',
)
ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**20), kind=st.sampled_from(["dtmc", "mdp"]), name=st.sampled_from(ENGINES)
)
def test_as_rational_arithmetic_has_them(seed, kind, name):
    text = random_model(Random(seed), kind).text
    try:
        exact, engine = engine_of(text, "exact"), engine_of(text, name)
    except (InputError, UnsupportedError):
        assume(False)
    for formula in FORMULAS:
        for direction in ("min", "max") if kind == "mdp" else ("",):
            asked = f"P{direction}=? [ {formula} ]"
            assert check_text(engine, asked).value == pytest.approx(
                float(check_text(exact, asked).value), rel=1e-6, abs=0
            ), asked


@pytest.mark.parametrize("name", ENGINES)
def test_steps(name):
    engine = engine_of(
        "dtmc module m x:[0..1] init 0; [] x=0 -> 0.1:(x'=0) + 0.9:(x'=1); [] x=1 -> true; endmodule",
        name,
    )
    for text in (
        "P=? [ G<=60 x=0 ]",
        "P=? [ G[60,60] x=0 ]",
        "P=? [ x=1 R<=60 x<1 ]",
        "P=? [ G[3,60] x=0 ]",
    ):
        assert check_text(engine, text).value == pytest.approx(1e-60, rel=1e-9, abs=0)


@pytest.mark.parametrize("name", ENGINES)
def test_time(name):
    engine = engine_of(
        "ctmc module m x:[0..2] init 0; [] x<2 -> 2:(x'=x+1); [] x=2 -> true; endmodule", name
    )
    for text, value in (
        ("P=? [ G<=20 x=0 ]", exp(-40)),
        ("P=? [ G[10,20] x=0 ]", exp(-40)),
        ("P=? [ G<=20 x<2 ]", 41 * exp(-40)),
        ("P=? [ !(x<2 U[10,20] x=2) ]", 1 - 21 * exp(-20)),
    ):
        assert check_text(engine, text).value == pytest.approx(value, rel=1e-6, abs=0), text


@pytest.mark.parametrize("name", ENGINES)
def test_strategies_that_could_wait(name):
    # Waiting keeps x below 30 for ever; the least probability is that of who goes on, rounds or not.
    text = """mdp module m x:[0..30] init 0;
        [go] x>0 & x<29 -> 0.3:(x'=x+1) + 0.7:(x'=30); [wait] x<29 -> true; [round] x<2 -> (x'=1-x); [] x>28 -> true; endmodule"""
    engine = engine_of(text, name)
    assert check_text(engine, "Pmin=? [ G x<30 ]").value == pytest.approx(0.3**28, rel=1e-6, abs=0)
    assert check_text(engine, "Pmax=? [ G x<30 ]").value == 1
    assert check_text(engine, "Pmin=? [ G<=29 x<30 ]").value == pytest.approx(
        0.3**28, rel=1e-6, abs=0
    )
