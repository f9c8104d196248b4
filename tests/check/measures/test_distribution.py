"""Distributions over the states of random small chains against matrix powers, exponentials and limits."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import symcheck
from exchange.models import some_model
from symcheck.check.state_distributions import initial_distribution, transient
from symcheck.errors import UnsupportedError, UsageError

ENGINES = ("explicit", "sparse", "mtbdd")


def dense(engine):
    """The matrix in full; of a CTMC, the generator."""
    m = engine.system(engine.all).weights
    full = np.zeros((m.rows, m.columns))
    full[np.repeat(np.arange(m.rows), np.diff(m.indptr)), m.indices] = m.data
    return full - np.diag(full.sum(axis=1)) if engine.model.type.value == "ctmc" else full


def within(found, expected):
    slack = 1e-9
    assert np.all(found.lower <= expected + slack)
    assert np.all(expected <= found.upper + slack)
    assert found.error <= 1e-6


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    engine=st.sampled_from(ENGINES),
    steps=st.sampled_from([0, 1, 2, 7, 1000]),
)
def test_steps_of_a_dtmc(seed, engine, steps):
    built = symcheck.loads(some_model(Random(seed), "dtmc").text, engine=engine)
    start = initial_distribution(built.engine)
    within(built.transient(steps), start @ np.linalg.matrix_power(dense(built.engine), steps))


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    engine=st.sampled_from(ENGINES),
    time=st.sampled_from([0, 0.1, 1, 5, 50]),
)
def test_times_of_a_ctmc(seed, engine, time):
    built = symcheck.loads(some_model(Random(seed), "ctmc").text, engine=engine)
    start = initial_distribution(built.engine)
    within(built.transient(time), start @ expm(dense(built.engine) * time))


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    engine=st.sampled_from(ENGINES),
    kind=st.sampled_from(["dtmc", "ctmc"]),
)
def test_the_long_run(seed, engine, kind):
    built = symcheck.loads(some_model(Random(seed), kind).text, engine=engine)
    full = dense(built.engine)
    # A lazy chain has the same long run, and no periods; squaring it often enough gives the limit.
    lazy = 0.5 * (
        np.eye(len(full))
        + (full if kind == "dtmc" else np.eye(len(full)) + full / (abs(full).max() * 2 or 1))
    )
    for _ in range(60):
        lazy = lazy @ lazy
        lazy /= lazy.sum(axis=1, keepdims=True)
    within(built.steady_state(), initial_distribution(built.engine) @ lazy)


def test_several_initial_states_are_equally_likely():
    text = "dtmc module m x:[0..3]; [] x<2 -> (x'=x+2); [] x>1 -> true; endmodule init x<3 endinit"
    model = symcheck.loads(text)
    assert model.transient(0).values.tolist() == pytest.approx([1 / 3, 1 / 3, 1 / 3, 0])
    assert model.steady_state().values.tolist() == pytest.approx([0, 0, 2 / 3, 1 / 3])
    assert next(iter(model.steady_state()))[:2] == (2, (2,))


def test_rational_arithmetic_builds_the_same():
    text = "dtmc module m x:[0..2]; [] x=0 -> 1/3:(x'=1)+2/3:(x'=2); endmodule"
    exact, plain = symcheck.loads(text, exact=True), symcheck.loads(text)
    within(exact.steady_state(), np.array([0, 1 / 3, 2 / 3]))
    assert exact.transient(1).values.tolist() == pytest.approx(plain.transient(1).values.tolist())


def test_another_initial_distribution():
    model = symcheck.loads("dtmc module m x:[0..1]; [] true -> (x'=1-x); endmodule")
    given_start = np.array([0.25, 0.75])
    assert transient(model.engine, 3, start=given_start).values.tolist() == pytest.approx(
        [0.75, 0.25]
    )
    for wrong in ([1.0], [0.5, 0.6], [-0.5, 1.5], [np.nan, 1.0]):
        with pytest.raises(UsageError, match="initial distribution"):
            transient(model.engine, 3, start=np.array(wrong))


def test_what_makes_no_sense():
    with pytest.raises(UnsupportedError, match="MDP"):
        symcheck.loads("mdp module m x:[0..1]; [] true -> true; endmodule").transient(1)
    chain = symcheck.loads("dtmc module m x:[0..1]; [] true -> true; endmodule")
    with pytest.raises(UsageError, match="whole steps"):
        chain.transient(0.5)
    for time in (-1, float("inf"), float("nan")):
        with pytest.raises(UsageError, match="not negative"):
            chain.transient(time)
