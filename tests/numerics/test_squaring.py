"""Repeated squaring against exponentials in balls and powers of matrices of fractions."""

from __future__ import annotations

import math
from fractions import Fraction

import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import sparse_of
from symcheck.matrices.rows import Floats
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient.squaring import IntervalChain, Powers
from symcheck.numerics.transient.values import transient_distribution, transient_values


def exponential(
    rates: Floats, leave: Floats, time: float, terminal: Floats, reward: Floats, digits: int
) -> list[object]:
    """x(time) for x' = Q x + reward, x(0) = terminal, as balls: e^M with M = ((Q, reward), 0) t."""
    n = len(leave)
    flint.ctx.dps = digits
    matrix = flint.arb_mat(n + 1, n + 1)
    t = flint.arb(time)
    for i in range(n):
        row = [flint.arb(float(rates[i, j])) for j in range(n)]
        for j in range(n):
            if i != j:
                matrix[i, j] = row[j] * t
        stay = sum((row[j] for j in range(n) if j != i), flint.arb(float(leave[i])))
        matrix[i, i] = -stay * t
        matrix[i, n] = flint.arb(float(reward[i])) * t
    power = matrix.exp()
    return [
        sum((power[i, j] * flint.arb(float(terminal[j])) for j in range(n)), power[i, n])
        for i in range(n)
    ]


def squared(rates: Floats, leave: Floats, time: float, terminal: Floats, reward: Floats) -> Powers:
    chain, earned, halvings = IntervalChain.of_rates(
        sparse_of(rates), leave, time, reward, tuning.ENTRY_ERROR
    )
    return chain.values(1 << halvings, (terminal, terminal), earned)


def assert_bounds(found: Powers, exact: list[object], width: float) -> None:
    for lower, upper, value in zip(found.lower, found.upper, exact, strict=True):
        assert not flint.arb(float(lower)) > value
        assert not flint.arb(float(upper)) < value
        assert upper - lower <= width * upper


def stiff_line() -> tuple[Floats, Floats]:
    """Nine states with the rates 1e6 and 1e-5; the ninth is the target."""
    rates, reward = np.zeros((8, 8)), np.zeros(8)
    for s in range(7):
        rates[s, s + 1] = 1e6 if s % 2 == 0 else 1e-5
        if s % 2:
            rates[s, s - 1] = 1e6
    rates[7, 6], reward[7] = 1e6, 1e-5
    return rates, reward


@pytest.mark.parametrize("time", [1e-3, 10.0, 1e4, 1e7, 1e12])
def test_stiff_chains_have_close_bounds_at_any_time(time: float) -> None:
    rates, reward = stiff_line()
    found = squared(rates, reward, time, np.zeros(8), reward)
    exact = exponential(rates, reward, time, np.zeros(8), reward, 200)
    assert_bounds(found, exact, 1e-10)


@pytest.mark.parametrize("time", [1.0, 1e6, 1e12, 1e14])
def test_slow_ways_between_fast_parts_keep_their_digits(time: float) -> None:
    """A fast pair that is left with the rate 1e-12: at 1e12, exactly what uniformisation in doubles cannot tell."""
    rates = np.array([[0.0, 1.0, 1e-12], [2.0, 0.0, 0.0], [1e-13, 0.3, 0.0]])
    leave = np.array([0.0, 1e-13, 0.0])
    terminal = np.array([0.0, 1.0, 0.0])
    found = squared(rates, leave, time, terminal, leave)
    assert_bounds(found, exponential(rates, leave, time, terminal, leave, 60), 1e-11)


def test_everything_is_absorbed_in_the_end() -> None:
    rate = np.array([7.0])
    found = squared(np.zeros((1, 1)), rate, 1e300, np.zeros(1), rate)
    assert found.lower[0] <= 1.0 <= found.upper[0]
    assert found.upper[0] - found.lower[0] <= 1e-12
    assert found.squarings < 1100


def test_a_walk_against_the_drift() -> None:
    """A metastable chain: it takes 2^60 to reach the end."""
    n = 40
    rates, reward = np.zeros((n, n)), np.zeros(n)
    rates[np.arange(n - 1), np.arange(1, n)] = 1.0
    rates[np.arange(1, n), np.arange(n - 1)] = 2.0
    reward[-1] = 1.0
    for time in (1e2, 1e6, 1e13):
        found = squared(rates, reward, time, np.zeros(n), reward)
        assert_bounds(found, exponential(rates, reward, time, np.zeros(n), reward, 100), 1e-9)


MAGNITUDES = st.sampled_from([0.0, 0.0, 1e-200, 1e-30, 1e-12, 1e-5, 0.3, 1.0, 7.0, 1e6])


@st.composite
def chains(draw: st.DrawFn) -> tuple[Floats, Floats, Floats, float]:
    n = draw(st.integers(1, 4))
    row = st.lists(MAGNITUDES, min_size=n, max_size=n)
    rates = np.array([draw(row) for _ in range(n)])
    np.fill_diagonal(rates, 0.0)
    return (
        rates,
        np.array(draw(row)),
        np.array(draw(row)),
        draw(st.sampled_from([1e-3, 1.0, 1e3, 1e9, 1e13])),
    )


@settings(max_examples=60, deadline=None)
@given(chains())
def test_bounds_hold_for_rates_of_any_magnitude(
    case: tuple[Floats, Floats, Floats, float],
) -> None:
    rates, leave, terminal, time = case
    found = squared(rates, leave, time, terminal, 0.5 * leave)
    for lower, upper, value in zip(
        found.lower,
        found.upper,
        exponential(rates, leave, time, terminal, 0.5 * leave, 900),
        strict=True,
    ):
        assert not flint.arb(float(lower)) > value
        assert not flint.arb(float(upper)) < value
        assert upper - lower <= 1e-9 * upper + 1e-290


@pytest.mark.parametrize("steps", [1, 2, 13, 1000, 20_000])
def test_powers_of_probabilities(steps: int) -> None:
    """Exactly, in fractions with powers of 2 as denominators; with a state that is left for good."""
    eighth = Fraction(1, 8)
    matrix = [[3 * eighth, 4 * eighth], [6 * eighth, 0 * eighth]]
    power, base, k = [[Fraction(1), Fraction(0)], [Fraction(0), Fraction(1)]], matrix, steps

    def product(a: list[list[Fraction]], b: list[list[Fraction]]) -> list[list[Fraction]]:
        return [
            [sum((a[i][m] * b[m][j] for m in (0, 1)), Fraction(0)) for j in (0, 1)] for i in (0, 1)
        ]

    while k:
        power, base, k = product(power, base) if k & 1 else power, product(base, base), k >> 1
    chain = IntervalChain.of_steps(
        sparse_of(np.array(matrix, float)), np.array([0.125, 0.25]), tuning.ENTRY_ERROR
    )
    assert chain is not None
    found = chain.values(steps, (np.array([1.0, 3.0]), np.array([1.0, 3.0])))
    for s in (0, 1):
        exact = power[s][0] + 3 * power[s][1]
        assert Fraction(float(found.lower[s])) <= exact <= Fraction(float(found.upper[s]))
        relative = float(found.upper[s] - found.lower[s]) - 1e-300
        assert relative <= 1e-10 * float(found.upper[s])


def test_a_periodic_chain_never_settles() -> None:
    chain = IntervalChain.of_steps(
        sparse_of(np.array([[0.0, 1.0], [1.0, 0.0]])), np.zeros(2), tuning.ENTRY_ERROR
    )
    assert chain is not None
    ends = np.array([2.0, 5.0])
    even, odd = (chain.values(10**30 + k, (ends, ends)) for k in (0, 1))
    for found, (first, second) in ((even, (2.0, 5.0)), (odd, (5.0, 2.0))):
        assert found.lower == pytest.approx([first, second], rel=1e-10)
        assert found.upper == pytest.approx([first, second], rel=1e-10)


def test_rows_that_do_not_sum_to_1_are_left_to_other_methods() -> None:
    off = sparse_of(np.array([[0.5, 0.4999999], [0.0, 1.0]]))
    assert IntervalChain.of_steps(off, np.zeros(2), tuning.ENTRY_ERROR) is None


def test_a_distribution_after_a_long_time() -> None:
    """The stationary one of two states, 2/3 and 1/3, within a few hundred multiplications."""
    rates = np.array([[0.0, 1.0], [2.0, 0.0]])
    found = transient_distribution(
        TransitionKernel(sparse_of(rates), rates.sum(1)), np.array([1.0, 0.0]), 1e200, Accuracy()
    )
    assert "squarings" in found.explanation
    assert found.iterations < 1000
    assert np.all(found.lower <= [2 / 3, 1 / 3])
    assert np.all(found.upper >= [2 / 3, 1 / 3])
    assert np.all(found.upper - found.lower <= 1e-10)


def line(n: int) -> tuple[Floats, Floats]:
    return np.diag(np.full(n - 1, 7.0), 1), np.append(np.zeros(n - 1), 7.0)


@pytest.mark.parametrize("time", [1e9, 1e13, 1e300])
def test_large_chains_end_once_all_is_absorbed(time: float) -> None:
    """An acyclic chain with equal rates: nothing is left after as many steps as it has states."""
    rates, goal = line(400)
    exit_rates = np.full(400, 7.0)
    for terminal, reward, exact in (
        (None, goal, np.ones(400)),
        (None, np.ones(400), np.arange(400, 0, -1) / 7.0),
        (np.ones(400), None, np.zeros(400)),
    ):
        found = transient_values(
            TransitionKernel(sparse_of(rates), exit_rates),
            time,
            Accuracy(),
            terminal=terminal,
            reward_rate=reward,
        )
        assert found.iterations <= 1000
        assert np.all(found.lower <= exact)
        assert np.all(found.upper >= exact)
        assert np.all(found.upper - found.lower <= 1e-6 * found.upper + 1e-299)


def test_large_chains_end_once_they_have_mixed() -> None:
    """What jumps from any of 400 states to any other is everywhere alike at once."""
    n, time = 400, 1e20
    rates = np.full((n, n), 1.0)
    np.fill_diagonal(rates, 0.0)
    exit_rates, reward = rates.sum(1), np.arange(float(n))
    mean = 0.5 * (n - 1)
    for terminal, rate, exact in ((reward, None, mean), (None, reward, mean * time)):
        found = transient_values(
            TransitionKernel(sparse_of(rates), exit_rates),
            time,
            Accuracy(),
            terminal=terminal,
            reward_rate=rate,
            leave=np.zeros(n),
        )
        assert found.iterations <= 1000
        assert np.all(found.lower <= exact * (1 + 1e-15))
        assert np.all(found.upper >= exact * (1 - 1e-15))
        assert np.all(found.upper - found.lower <= 1e-6 * found.upper)


def test_a_horizon_that_is_too_long_ends_with_wide_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slow chain that is not squared: after the budget, the bounds so far are the result."""
    monkeypatch.setattr(tuning, "SERIES_ENTRIES", 1e5)
    monkeypatch.setattr(tuning, "LONG_SERIES_ENTRIES", 1e6)
    n = 400
    rates, reward = np.zeros((n, n)), np.zeros(n)
    rates[np.arange(n - 1), np.arange(1, n)] = 1.0
    rates[np.arange(1, n), np.arange(n - 1)] = 2.0
    reward[-1] = 1.0
    found = transient_values(
        TransitionKernel(sparse_of(rates), rates.sum(1) + reward),
        1e12,
        Accuracy(),
        reward_rate=reward,
        limit=lambda: np.ones(n),
    )
    assert found.iterations <= 1000
    assert np.all(found.lower <= found.upper)
    assert found.upper[0] <= 1.0
    assert math.isfinite(found.upper.max())
