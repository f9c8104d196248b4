"""Stiff chains by implicit means: the error that is claimed holds against a matrix exponential, however bad the space is."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import scaled
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient import rational_krylov
from symcheck.numerics.transient.rational_krylov import krylov_values
from symcheck.numerics.transient.values import transient_values

EVERYWHERE = Accuracy(epsilon=1e-6)


def stiff(n: int, seed: int, leak: float = 0.0) -> tuple[Floats, SparseMatrix, Floats]:
    """A generator whose rates span five orders of magnitude, its rates and its exit rates."""
    rng = np.random.default_rng(seed)
    rates = np.zeros((n, n))
    for step, fast in ((1, 1e3), (2, 1.0), (5, 0.02)):
        rates[np.arange(n), (np.arange(n) + step) % n] += fast * rng.random(n)
        rates[np.arange(n), (np.arange(n) - step) % n] += fast * rng.random(n)
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    matrix = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], n)
    leave = rates.sum(1) + leak * rng.random(n)
    return rates - np.diag(leave), matrix, leave


def exact(generator: Floats, start: Floats, reward_rate: Floats, time: float) -> Floats:
    n = len(start)
    wide = np.zeros((n + 1, n + 1))
    wide[:n, :n], wide[:n, n] = generator, reward_rate
    return np.asarray((expm(wide * time) @ np.append(start, 1.0))[:n])


@pytest.mark.parametrize("leak", [0.0, 0.3])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_values_are_within_the_error_everywhere(seed: int, leak: float) -> None:
    generator, rates, leave = stiff(60, seed, leak)
    reward_rate = np.random.default_rng(seed).random(60)
    found = krylov_values(rates, leave, np.zeros(60), reward_rate, 20.0, np.arange(60), EVERYWHERE)
    assert found is not None
    assert (
        np.max(np.abs(found.values - exact(generator, np.zeros(60), reward_rate, 20.0)))
        <= found.error
    )
    assert 2.0 * found.error <= 1e-6 * found.values.min()


@pytest.mark.parametrize("loose", [1e-3, 1e-6, 1e-9])
def test_a_bad_space_costs_width_and_nothing_else(
    loose: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "VECTOR_RESIDUAL", loose)
    generator, rates, leave = stiff(40, 7)
    start, reward_rate = np.linspace(1.0, 2.0, 40), np.ones(40)
    found = krylov_values(
        rates, leave, start, reward_rate, 5.0, np.arange(40), Accuracy(epsilon=1e9, relative=False)
    )
    assert found is not None
    assert np.max(np.abs(found.values - exact(generator, start, reward_rate, 5.0))) <= found.error


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_may_sum_to_more_than_their_exit_rate(seed: int) -> None:
    """As they do where values are divided by weights: the error grows as exp(Q t) may."""
    generator, rates, leave = stiff(40, seed)
    weights, reward_rate = 10.0 ** np.random.default_rng(seed).uniform(-0.02, 0.02, 40), np.ones(40)
    relative = scaled(rates, weights)
    found = krylov_values(
        relative,
        leave,
        np.zeros(40),
        reward_rate / weights,
        0.02,
        np.arange(40),
        Accuracy(epsilon=1e9, relative=False),
    )
    assert found is not None
    truth = exact(generator, np.zeros(40), reward_rate, 0.02) / weights
    assert np.max(np.abs(found.values - truth)) <= found.error


@pytest.mark.parametrize("quick", [1500, 0])
def test_weights_are_about_the_values_and_grow_as_slowly_as_asked(
    quick: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "WEIGHT_ELIMINATION_OPERATIONS", quick)  # by elimination, or not
    generator, rates, leave = stiff(60, 4, 0.3)
    reward_rate = np.zeros(60)
    reward_rate[0] = 1e-3
    weights = rational_krylov.importance(rates, leave, reward_rate, 20.0, np.full(60, 1e-4))
    assert weights is not None
    assert np.max(generator @ weights / weights) <= tuning.IMPORTANCE_SHIFT / 20.0 * 1.01
    ratio = exact(generator, np.zeros(60), reward_rate, 20.0) / weights
    assert ratio.max() <= 100.0 * ratio.min()


def test_samples_between_the_nodes_are_those_of_the_polynomial() -> None:
    nodes = -np.cos(np.pi * np.arange(tuning.COLLOCATION_DEGREE + 1) / tuning.COLLOCATION_DEGREE)
    points = -np.cos(np.pi * np.arange(tuning.SAMPLES + 1) / tuning.SAMPLES)
    for k in range(tuning.COLLOCATION_DEGREE + 1):
        assert rational_krylov._chebyshev()[1] @ nodes**k == pytest.approx(points**k, abs=1e-13)


def test_loops_count_as_no_change() -> None:
    generator, _, leave = stiff(30, 5)
    dense = np.diag(np.full(30, 7.0)) + generator + np.diag(leave)
    nonzero = dense > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    looped = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), dense[nonzero], 30)
    reward_rate = np.linspace(0.5, 1.0, 30)
    found = krylov_values(
        looped, leave + 7.0, np.zeros(30), reward_rate, 10.0, np.arange(30), EVERYWHERE
    )
    assert found is not None
    assert (
        np.max(np.abs(found.values - exact(generator, np.zeros(30), reward_rate, 10.0)))
        <= found.error
    )


@pytest.mark.parametrize("kind", ["reward_rate", "terminal"])
def test_long_stiff_horizons_are_left_to_it(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "KRYLOV_ENTRIES", 1e5)
    generator, rates, leave = stiff(60, 4, 0.05)
    values = np.linspace(1.0, 3.0, 60)
    given = {"reward_rate": values} if kind == "reward_rate" else {"terminal": values}
    found = transient_values(
        TransitionKernel(rates, leave), 30.0, Accuracy(), interest=np.array([3], np.int64), **given
    )
    assert "rational Krylov" in found.explanation
    zero = np.zeros(60)
    true = (
        exact(generator, zero, values, 30.0)
        if kind == "reward_rate"
        else exact(generator, values, zero, 30.0)
    )
    assert found.lower[3] <= true[3] * (1 + 1e-11)
    assert found.upper[3] >= true[3] * (1 - 1e-11)
    assert found.upper[3] - found.lower[3] <= 1e-6 * found.upper[3]


def test_what_is_rare_is_left_to_uniformisation(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error relative to the greatest value says nothing where the value of interest is a billionth of it."""
    monkeypatch.setattr(tuning, "KRYLOV_ENTRIES", 1e5)
    monkeypatch.setattr(tuning, "KRYLOV_STEPS", 1e3)
    _, rates, leave = stiff(40, 9)
    slow = SparseMatrix(rates.indptr, rates.indices, rates.data, 40)
    reward_rate = np.zeros(40)
    reward_rate[20] = 1e-9
    found = transient_values(
        TransitionKernel(slow, leave + 1.0),
        20.0,
        Accuracy(),
        reward_rate=reward_rate,
        interest=np.array([0], np.int64),
    )
    assert found.upper[0] - found.lower[0] <= 1e-6 * found.upper[0]


@pytest.mark.parametrize("poles", [(15.0,), (20.0, 150.0, 800.0), (3.0, 1e4)])
def test_poles_may_be_any(poles: tuple[float, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tuning, "KRYLOV_ELIMINATION_STATES", 0)
    generator, rates, leave = stiff(60, 2, 0.3)
    start, reward_rate = np.linspace(1.0, 2.0, 60), np.ones(60)
    found = krylov_values(
        rates,
        leave,
        start,
        reward_rate,
        2.0,
        np.arange(60),
        Accuracy(epsilon=1e9, relative=False),
        poles=poles,
    )
    assert found is not None
    assert np.max(np.abs(found.values - exact(generator, start, reward_rate, 2.0))) <= found.error


def test_later_vectors_take_fewer_steps_and_the_error_holds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Their coefficients are small, so that their residuals may be large."""
    monkeypatch.setattr(tuning, "KRYLOV_ELIMINATION_STATES", 0)
    generator, rates, leave = stiff(200, 2, 0.3)
    reward_rate = np.random.default_rng(2).random(200)
    zeros, everywhere = np.zeros(200), np.arange(200)
    truth = exact(generator, zeros, reward_rate, 2.0)
    steps = []
    for share in (0.0, tuning.VECTOR_SHARE):
        monkeypatch.setattr(tuning, "VECTOR_SHARE", share)
        found = krylov_values(rates, leave, zeros, reward_rate, 2.0, everywhere, EVERYWHERE)
        assert found is not None
        assert np.max(np.abs(found.values - truth)) <= found.error
        assert 2.0 * found.error <= 1e-6 * found.values.min()
        steps.append(found.steps / found.vectors)
    assert steps[1] < 0.8 * steps[0]


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("bound", [1e18, math.inf, math.nan])
def test_a_projection_that_explodes_is_passed_over(
    which: int, bound: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, rates, leave = stiff(60, 1)
    reward_rate = np.random.default_rng(1).random(60)
    arguments = (rates, leave, np.zeros(60), reward_rate, 20.0, np.arange(60), EVERYWHERE)
    found = krylov_values(*arguments)
    assert found is not None
    defect, bounds = rational_krylov._defect, list[float]()

    def one_explodes(*parts: Any) -> float:
        bounds.append(bound if len(bounds) == which else defect(*parts))
        return bounds[-1]

    monkeypatch.setattr(rational_krylov, "_defect", one_explodes)
    again = krylov_values(*arguments)
    assert again is not None
    assert len(bounds) > 2
    assert again.vectors == found.vectors
    assert again.values.tobytes() == found.values.tobytes()


def test_convergence_is_not_judged_by_the_first_size(monkeypatch: pytest.MonkeyPatch) -> None:
    _, rates, leave = stiff(60, 1)
    monkeypatch.setattr(tuning, "SUBSPACE_SIZES", (24, 40))
    monkeypatch.setattr(tuning, "LARGER_SUBSPACE_SIZES", (60,))
    reward_rate = np.random.default_rng(1).random(60)
    found = krylov_values(
        rates, leave, np.zeros(60), reward_rate, 20.0, np.arange(60), Accuracy(epsilon=1e-12)
    )
    assert found is None or found.vectors > 24


def test_rates_too_large_for_any_accuracy_have_no_subspace() -> None:
    _, rates, leave = stiff(10, 2, 0.3)
    fast = replace(rates, data=rates.data * 1e30)
    found = krylov_values(
        fast, leave * 1e30, np.ones(10), None, 1.0, np.arange(10), Accuracy(epsilon=1e-6)
    )
    assert found is None


def test_what_just_misses_the_accuracy_is_not_thrown_away() -> None:
    """Rounding does not allow for 1e-15: the closest bounds found still hold, and others may take for ever."""
    generator, rates, leave = stiff(60, 1, 0.0)
    reward_rate = np.random.default_rng(1).random(60)
    found = krylov_values(
        rates, leave, np.zeros(60), reward_rate, 20.0, np.arange(60), Accuracy(epsilon=1e-15)
    )
    assert found is not None
    error = np.max(np.abs(found.values - exact(generator, np.zeros(60), reward_rate, 20.0)))
    assert error <= found.error <= 1e-3 * found.values.min()
