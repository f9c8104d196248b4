"""Time-bounded properties of random small CTMCs against matrix exponentials."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from checking import check_text, engine_of
from generate import random_model
from symcheck.errors import InputError, UnsupportedError
from symcheck.semantics.rewards import Structure


def dense(engine):
    """The rates as a full matrix."""
    m = engine.weights
    rates = np.zeros((m.states, m.states))
    rows = np.repeat(np.arange(m.rows), np.diff(m.indptr))
    np.add.at(rates, (rows, m.indices), m.data)
    return rates


def generator(rates, keep):
    """The generator of the chain in which states outside of `keep` are absorbing."""
    q = rates - np.diag(rates.sum(axis=1))
    return np.where(keep[:, None], q, 0.0)


def until(rates, left, right, lower, upper):
    """left U[lower,upper] right: within `left` for time lower, then towards `right`."""
    value = expm(generator(rates, left & ~right) * (upper - lower)) @ right.astype(float)
    if lower > 0:
        value = expm(generator(rates, left) * lower) @ np.where(left, value, 0.0)
        value = np.where(left, value, 0.0)
    return value


@st.composite
def chains(draw):
    model = random_model(Random(draw(st.integers(0, 2**20))), "ctmc")
    try:
        return engine_of(model.text)
    except (InputError, UnsupportedError):
        assume(False)


BOUNDS = [
    ("<=0.5", 0, 0.5),
    ("<2", 0, 2),
    ("[0.3,2]", 0.3, 2),
    ("[1,1]", 1, 1),
    ("=0.25", 0.25, 0.25),
    ("<=0", 0, 0),
]


@pytest.mark.parametrize(("bound", "lower", "upper"), BOUNDS)
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(engine=chains())
def test_until(bound, lower, upper, engine):
    a, b = (engine.where(engine.model.labels[name]).members for name in "ab")
    result = check_text(engine, f'P=? [ "a" U{bound} "b" ]')
    low, high = result.values.at(engine.initial)
    true = until(dense(engine), a, b, lower, upper)[engine.initial.members]
    assert np.all(low - 1e-9 <= true)
    assert np.all(true <= high + 1e-9)
    assert np.all(high - low <= 1e-6 * high + 1e-12)


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(engine=chains(), time=st.sampled_from([0.1, 1.0, 3.5]))
def test_rewards(engine, time):
    rates, n = dense(engine), engine.states
    states, rows = engine.rewards(Structure(0))
    q = generator(rates, np.ones(n, bool))
    instant = expm(q * time) @ states
    # The integral of exp(Qu) r over u from 0 to t is in the corner of the exponential of a larger matrix.
    larger = np.zeros((n + 1, n + 1))
    larger[:n, :n], larger[:n, n] = q, states + rows
    gathered = expm(larger * time)[:n, n]
    for text, true in ((f"R=? [ I={time} ]", instant), (f"R=? [ C<={time} ]", gathered)):
        low, high = check_text(engine, text).values.at(engine.initial)
        assert low == pytest.approx(true[engine.initial.members], rel=1e-6, abs=1e-9)
        assert high == pytest.approx(true[engine.initial.members], rel=1e-6, abs=1e-9)


def test_unbounded_end():
    """left U>=t right goes on without end after time t."""
    engine = engine_of("ctmc module m x:[0..2]; [] x=0 -> 1:(x'=1) + 1:(x'=2); endmodule")
    assert check_text(engine, "P=? [ F>=3 x=1 ]").value == pytest.approx(0.5, rel=1e-6)
    # The run must still be at 0 at time 1, and then go to 1.
    assert check_text(engine, "P=? [ x=0 U>=1 x=1 ]").value == pytest.approx(
        0.5 * np.exp(-2), rel=1e-6
    )


def test_both_parts_of_an_interval_are_accurate():
    """What follows the lower bound matters at all states that are reached by then, not at the initial ones only."""
    text = "ctmc module m x:[0..3] init 0; [] x=0 -> 3:(x'=1); [] x=1 -> 1:(x'=2) + 2:(x'=0); [] x=2 -> 0.5:(x'=3) + 1:(x'=1); endmodule"
    engine = engine_of(text)
    everywhere, start = np.ones(4, bool), np.array([True, False, False, False])
    result = check_text(engine, "P=? [ F[0.5,2] x=0 ]")
    assert result.value == pytest.approx(
        until(dense(engine), everywhere, start, 0.5, 2)[0], rel=1e-6
    )
    assert not result.warnings


def test_next_in_time():
    engine = engine_of("ctmc module m x:[0..2]; [] x=0 -> 1:(x'=1) + 3:(x'=2); endmodule")
    assert check_text(engine, "P=? [ X<=0.5 x=1 ]").value == pytest.approx(
        0.25 * -np.expm1(-2), rel=1e-9
    )
    assert check_text(engine, "P=? [ X[0.5,1] x=1 ]").value == pytest.approx(
        0.25 * (np.exp(-2) - np.exp(-4)), rel=1e-9
    )
