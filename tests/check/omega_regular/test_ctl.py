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
    owner = (
        np.arange(m.states)
        if m.groups is None
        else np.repeat(np.arange(m.states), np.diff(m.groups))
    )
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
    a, b = (
        frozenset(np.flatnonzero(engine.where(engine.model.labels[name]).members).tolist())
        for name in "ab"
    )
    path = f'{operator} "a"' if operator in "XFG" else f'"a" {operator} "b"'
    for sign in ("", "!"):
        result = check_text(
            engine, f"{quantifier} [ {path} ]" if not sign else f"!({quantifier} [ {path} ])"
        )
        expected = ctl(quantifier, operator, a, b, successors(engine))
        found = frozenset(np.flatnonzero(result.satisfying.mask).tolist())
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
    assert check_text(engine_of(WALK), "E [ G x!=3 ]").witness_or_none is None
    assert check_text(engine_of(WALK), "E [ F x=3 & x=0 ]").witness_or_none is None


def bounded(lower, upper, a, b, following):
    """The states of E [ a U[lower,upper] b ], step by step."""
    found = b
    for _ in range(upper - lower):
        found = b | (a & pre(found, following))
    for _ in range(lower):
        found = a & pre(found, following)
    return found


def pre(states, following):
    return frozenset(s for s in range(len(following)) if following[s] & states)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**20),
    kind=st.sampled_from(["dtmc", "mdp"]),
    name=st.sampled_from(["explicit", "mtbdd", "exact"]),
    bounds=st.sampled_from([(0, 0), (0, 1), (0, 3), (1, 1), (1, 4), (2, 2), (3, 40)]),
)
def test_bounds_on_steps(seed, kind, name, bounds):
    engine, following, a, b = drawn(seed, kind, name)
    lower, upper = bounds
    everything = frozenset(range(len(following)))
    window = f"[{lower},{upper}]"
    assert satisfied(engine, f'E [ "a" U{window} "b" ]') == bounded(lower, upper, a, b, following)
    assert satisfied(engine, f'E [ F{window} "b" ]') == bounded(
        lower, upper, everything, b, following
    )
    assert satisfied(engine, f'A [ G{window} "b" ]') == everything - bounded(
        lower, upper, everything, everything - b, following
    )
    # E [ a R b ]: the negation of every path's !a U !b.
    unreleased = satisfied(engine, f'A [ !"a" U{window} !"b" ]')
    assert satisfied(engine, f'E [ "a" R{window} "b" ]') == everything - unreleased


def test_bounds_on_steps_of_all_paths():
    engine = engine_of(WALK)
    assert check_text(engine, "A [ F<=1 x>0 ]").value is True
    assert check_text(engine, "A [ F<=2 x=3 | x=2 ]").value is True
    assert check_text(engine, "A [ F<=1 x=3 | x=2 ]").value is False
    assert check_text(engine, "A [ x<1 U[1,1] x>0 ]").value is True
    assert check_text(engine, "A [ x<2 W<=1 x=3 ]").value is False
    assert check_text(engine, "E [ X>=2 x=3 ]").value is False


LINEAR = {
    '(G F "a") & (G F "b")': lambda a, b, m: again((a, b), m),
    'F G "a"': lambda a, b, m: ctl("E", "F", ctl("E", "G", a, a, m), a, m),
    '(G F "a") => (G F "b")': lambda a, b, m: (
        ctl("E", "F", ctl("E", "G", frozenset(range(len(m))) - a, a, m), a, m) | again((b,), m)
    ),
    'F ("a" & (X "b"))': lambda a, b, m: ctl("E", "F", a & pre(b, m), a, m),
    'G ("a" => (X "b"))': lambda a, b, m: fixpoint(
        lambda z: z & pre(z, m) & ((frozenset(range(len(m))) - a) | pre(b & z, m)),
        frozenset(range(len(m))),
    ),
    '"a" U ("b" U "a")': lambda a, b, m: ctl("E", "U", a, ctl("E", "U", b, a, m), m),
    'X X "b"': lambda a, b, m: pre(pre(b, m), m),
}


def again(sets, following):
    """The states with a path that meets each of the sets again and again."""
    everything = frozenset(range(len(following)))

    def step(z):
        return frozenset.intersection(
            z, *(pre(ctl("E", "F", x & z, x, following), following) for x in sets)
        )

    return fixpoint(step, everything)


@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 2**20),
    kind=st.sampled_from(["dtmc", "ctmc", "mdp"]),
    name=st.sampled_from(["explicit", "mtbdd", "exact"]),
)
def test_linear_time(seed, kind, name):
    engine, following, a, b = drawn(seed, kind, name)
    for formula, states in LINEAR.items():
        found = states(a, b, following)
        assert satisfied(engine, f"E [ {formula} ]") == found
        assert satisfied(engine, f"A [ !({formula}) ]") == frozenset(range(len(following))) - found


def drawn(seed, kind, name):
    """A random model: an engine, the successors of each state, and the states of its labels a and b."""
    text = random_model(Random(seed), kind).text
    try:
        plain = engine_of(text)
    except (InputError, UnsupportedError):
        assume(False)
    a, b = (
        frozenset(np.flatnonzero(plain.where(plain.model.labels[name]).members).tolist())
        for name in "ab"
    )
    return engine_of(text, name), successors(plain), a, b


def satisfied(engine, text):
    """Numbers of the states that satisfy a formula."""
    return frozenset(np.flatnonzero(check_text(engine, text).satisfying.mask).tolist())


def test_a_nested_in_p():
    text = """dtmc module m x:[0..3] init 0; [] x=0 -> 0.25:(x'=1) + 0.75:(x'=2); [] x=1 -> (x'=3); [] x=3 -> (x'=1);
    [] x=2 -> 0.5:(x'=2) + 0.5:(x'=3); endmodule"""
    engine = engine_of(text)
    assert check_text(engine, "P=? [ X A [ G F x=3 ] ]").value == 0.25
    assert check_text(engine, "P>=1 [ G F x=3 ]").value is True
    assert check_text(engine, "E [ F G x=2 ]").value is True


def test_a_long_chain_is_not_taken_apart_state_by_state():
    engine = engine_of(
        "dtmc module m x:[0..20000] init 0; [] x<20000 -> (x'=x+1); [] x=20000 -> true; endmodule"
    )
    assert check_text(engine, "E [ G F x<20000 ]").value is False


def test_what_is_refused():
    with pytest.raises(UnsupportedError, match="bound on time"):
        check_text(
            engine_of("ctmc module m x:[0..1] init 0; [] x=0 -> (x'=1); endmodule"),
            "E [ F<=3 x=1 ]",
        )
    with pytest.raises(UnsupportedError, match="bound on a reward"):
        check_text(
            engine_of(WALK + ' rewards "r" true : 1; endrewards'), 'E [ F^{rew{"r"}<=3} x=3 ]'
        )
