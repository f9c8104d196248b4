"""A and E against the fixpoints that define them, on random models; and the paths that show why."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model
from symcheck.engines.registry import BUILDERS
from symcheck.errors import InputError, UnsupportedError


def successors(engine):
    m = engine.matrix
    owner = np.arange(m.states) if m.groups is None else np.repeat(np.arange(m.states), np.diff(m.groups))
    following = [set() for _ in range(m.states)]
    for r in range(m.rows):
        following[owner[r]].update(m.indices[m.indptr[r] : m.indptr[r + 1]].tolist())
    return following


def fixpoint(step, start):
    while (following := step(start)) != start:
        start = following
    return start


def ctl(quantifier, operator, a, b, following):
    """The states of `quantifier [ a operator b ]`, by iterating the defining equations."""
    everything = frozenset(range(len(following)))
    some = any if quantifier == "E" else all

    def pre(x):
        return frozenset(s for s in everything if some(t in x for t in following[s]))

    match operator:
        case "X":
            return pre(a)
        case "F":
            return fixpoint(lambda x: a | pre(x), frozenset())
        case "G":
            return fixpoint(lambda x: a & pre(x), everything)
        case "U":
            return fixpoint(lambda x: b | (a & pre(x)), frozenset())
        case "W":
            return fixpoint(lambda x: b | (a & pre(x)), everything)
        case "R":
            return fixpoint(lambda x: b & (a | pre(x)), everything)


@pytest.mark.parametrize("quantifier", ["A", "E"])
@pytest.mark.parametrize("operator", ["X", "F", "G", "U", "W", "R"])
@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**20), kind=st.sampled_from(["dtmc", "mdp"]))
def test_fixpoints(quantifier, operator, seed, kind):
    try:
        engine = engine_of(random_model(Random(seed), kind).text)
    except (InputError, UnsupportedError):
        assume(False)
    a, b = (frozenset(np.flatnonzero(engine.where(engine.model.labels[name]).members).tolist()) for name in "ab")
    path = f'{operator} "a"' if operator in "XFG" else f'"a" {operator} "b"'
    for sign in ("", "!"):
        result = check_text(engine, f"{quantifier} [ {path} ]" if not sign else f"!({quantifier} [ {path} ])")
        expected = ctl(quantifier, operator, a, b, successors(engine))
        found = frozenset(np.flatnonzero(result.satisfying.members).tolist())
        assert found == (frozenset(range(engine.states)) - expected if sign else expected)


WALK = "dtmc module m x:[0..3] init 0; [] x=0 -> 0.5:(x'=1) + 0.5:(x'=2); [] x=1 -> (x'=3); [] x=2 -> true; endmodule"


@pytest.mark.parametrize("name", [n for n in BUILDERS if n != "exact"])
def test_witness_of_a_deadlock(name):
    result = check_text(engine_of(WALK, name), 'E [ F "deadlock" ]')
    assert result.value is True
    assert [dict(s) for s in result.witness] == [{"x": 0}, {"x": 1}, {"x": 3}]


def test_counterexample():
    result = check_text(engine_of(WALK), "A [ G x<3 ]")
    assert result.value is False
    assert [s["x"] for s in result.witness] == [0, 1, 3]


def test_no_witness_where_none_is_finite():
    assert check_text(engine_of(WALK), "E [ G x!=3 ]").witness is None
    assert check_text(engine_of(WALK), "E [ F x=3 & x=0 ]").witness is None


def test_bounds_are_refused():
    with pytest.raises(UnsupportedError, match="bound"):
        check_text(engine_of(WALK), "E [ F<=3 x=3 ]")
