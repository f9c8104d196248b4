"""Formulas on the quotient by bisimulation: the same values as on the model."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model, random_property
from symcheck.errors import InputError, UnsupportedError

SLOW = settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))


def random_engine(seed, kind):
    try:
        return random_model(Random(seed), kind, largest=5), engine_of(random_model(Random(seed), kind, largest=5).text)
    except InputError:
        assume(False)


@SLOW
@given(seed=st.integers(0, 2**20), kind=st.sampled_from(["dtmc", "ctmc", "mdp"]))
def test_the_same_values(seed, kind):
    model, engine = random_engine(seed, kind)
    rng = Random(seed + 1)
    for _ in range(3):
        text = random_property(rng, model)
        try:
            want = check_text(engine, text)
        except UnsupportedError:
            assume(False)
        found = check_text(engine, text, bisim=True)
        for one, other in zip(want.values.at(engine.all), found.values.at(engine.all), strict=True):
            assert other == pytest.approx(one, rel=1e-5, abs=1e-9), text


def test_symmetric_parts_are_lumped():
    part = "module m{0}\n x{0} : [0..2];\n [] x{0}=0 -> 2:(x{0}'=1);\n [] x{0}=1 -> 1:(x{0}'=2) + 3:(x{0}'=0);\nendmodule\n"
    text = "ctmc\n" + "".join(part.format(i) for i in range(5))
    engine = engine_of(text + 'label "all" = ' + " & ".join(f"x{i}=2" for i in range(5)) + ";\n")
    result = check_text(engine, 'P=? [ F<=2 "all" ]', bisim=True)
    assert "243 states -> 21" in result.explanation  # multisets of 5 of 3 states
    assert result.value == pytest.approx(check_text(engine, 'P=? [ F<=2 "all" ]').value, rel=1e-6)
    assert check_text(engine, 'P>=0.99 [ F "all" ]', bisim=True).value is True
    assert check_text(engine, 'P=? [ F "init" ]', bisim=True).value == 1


@pytest.mark.parametrize("text", ["filter(max, P=? [ F x=1 ])", "E [ F x=1 ]"])
def test_what_is_checked_without(text):
    engine = engine_of("dtmc\nmodule m\n x : [0..1];\n [] true -> 0.5:(x'=0) + 0.5:(x'=1);\nendmodule\n")
    assert any("without -bisim" in w for w in check_text(engine, text, bisim=True).warnings)


def test_a_threshold_at_the_value():
    engine = engine_of("dtmc\nmodule m\n x : [0..4];\n [] x=0 -> 1/3:(x'=1) + 1/3:(x'=2) + 1/3:(x'=3);\n [] x>0 -> true;\nendmodule\n")
    result = check_text(engine, "P>=2/3 [ F x=1|x=2 ]", bisim=True)
    assert result.value is True
    assert result.engine.states == 4


@pytest.mark.parametrize("engine", ["auto", "sparse"])
def test_other_engines_answer(engine):
    text = "dtmc\nmodule m\n x : [0..4];\n [] x=0 -> 1/3:(x'=1) + 1/3:(x'=2) + 1/3:(x'=3);\n [] x>0 -> true;\nendmodule\n"
    assert check_text(engine_of(text, engine), "P=? [ F x=1|x=2 ]", bisim=True).value == pytest.approx(2 / 3)
