"""Forward uniformisation on active states: closed forms, and other methods on the same chain."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient.forward import forward_value
from symcheck.numerics.transient.values import transient_values


def line(n: int, right: float, left: float = 0.0) -> tuple[SparseMatrix, Floats]:
    """A line of n states with rates to the neighbours; the last state also leaves to the right."""
    rates = np.diag(np.full(n - 1, right), 1) + np.diag(np.full(n - 1, left), -1)
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    indices = np.nonzero(nonzero)[1].astype(np.int32)
    exit_rates = rates.sum(1)
    exit_rates[-1] += right
    return SparseMatrix(indptr, indices, rates[nonzero], n), exit_rates


def arrivals_within(n: int, mean: int) -> Fraction:
    """P(N >= n) for a Poisson variable with an integer mean, to 50 digits."""
    sum_to, term = Fraction(0), Fraction(1)
    for k in range(n, n + 20 * mean):
        term = term * mean / k if k > n else Fraction(mean**n, math.factorial(n))
        sum_to += term
    exp = Fraction(1)
    part = Fraction(1)
    for k in range(1, 20 * mean):
        part = part * mean / k
        exp += part
    return sum_to / exp


@pytest.mark.parametrize("n", [60, 200, 400])
def test_a_pure_birth_process_reaches_its_end_as_a_poisson_process_does(n: int) -> None:
    rates, exit_rates = line(n, 1.0)
    into_target: Floats = np.zeros(n)
    into_target[-1] = 1.0
    run = forward_value(rates, exit_rates, into_target, 50.0, True, 0, Accuracy(), None)
    truth = arrivals_within(n, 50)  # 5e-185 for 400 states: what is dropped must be smaller
    assert Fraction(run.lower) <= truth <= Fraction(run.upper)
    assert run.upper - run.lower <= 1e-6 * run.upper


def test_a_rare_value_at_a_time_has_a_small_relative_error() -> None:
    rates, exit_rates = line(200, 1.0)
    run = forward_value(rates, exit_rates, np.eye(200)[150], 50.0, False, 0, Accuracy(), None)
    truth = arrivals_within(150, 50) - arrivals_within(151, 50)  # 2.4e-30
    assert Fraction(run.lower) <= truth <= Fraction(run.upper)
    assert run.upper - run.lower <= 1e-6 * run.upper


@pytest.mark.parametrize("source", [False, True])
def test_values_agree_with_the_series_over_all_states(source: bool) -> None:
    rates, exit_rates = line(3000, 5.0, 3.0)
    exit_rates[-1] -= 5.0  # a state that is not left any more
    start = np.arange(3000.0)
    run = forward_value(rates, exit_rates, start, 40.0, source, 700, Accuracy(), None)
    series = transient_values(
        TransitionKernel(rates, exit_rates),
        40.0,
        Accuracy(),
        **{"reward_rate" if source else "terminal": start},
    )
    assert run.largest < 1500
    assert max(run.lower, series.lower[700]) <= min(run.upper, series.upper[700])
    assert run.upper - run.lower <= 1e-6 * run.upper


def test_many_active_states_end_the_attempt() -> None:
    rates, exit_rates = line(40, 5.0, 5.0)
    run = forward_value(rates, exit_rates, np.ones(40), 100.0, True, 20, Accuracy(), None)
    assert run.upper == np.inf
    assert 0.0 < run.lower <= 100.0


def test_an_attempt_that_would_take_too_long_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    rates, exit_rates = line(3000, 5.0, 3.0)
    monkeypatch.setattr(tuning, "FORWARD_WORK", 100_000)
    run = forward_value(rates, exit_rates, np.ones(3000), 40.0, True, 700, Accuracy(), None)
    assert run.upper == np.inf


def test_one_state_of_interest_is_followed_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "FORWARD_ENTRIES", 1.0)
    rates, exit_rates = line(3000, 5.0, 3.0)
    reward = np.arange(3000.0)
    all_values = transient_values(
        TransitionKernel(rates, exit_rates), 40.0, Accuracy(), terminal=reward
    )
    one = transient_values(
        TransitionKernel(rates, exit_rates),
        40.0,
        Accuracy(),
        terminal=reward,
        interest=np.array([700]),
    )
    assert "forward" in one.explanation
    assert "forward" not in all_values.explanation
    assert np.all(one.lower <= all_values.upper)
    assert np.all(all_values.lower <= one.upper)
    assert one.upper[700] - one.lower[700] <= 1e-6 * one.upper[700]
