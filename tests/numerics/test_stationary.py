"""Long-run behaviour against rational arithmetic and closed forms."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import sparse_of
from symcheck.kernels.chains.gth_elimination import GthElimination
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear import rational
from symcheck.numerics.long_run import stationary
from symcheck.numerics.settings import Accuracy


@settings(max_examples=150, deadline=None)
@given(st.integers(1, 8), st.data())
def test_small_chains(n: int, data: st.DataObject) -> None:
    """Rates that differ by twelve orders of magnitude: every entry keeps its digits."""
    rate = st.sampled_from([0.0, 0.0, 1e-9, 1.0, 1e3])
    rates = np.array(
        data.draw(st.lists(st.lists(rate, min_size=n, max_size=n), min_size=n, max_size=n))
    )
    rates += 1e-6 * np.roll(np.eye(n), 1, axis=1)
    matrix = sparse_of(rates)
    exact = rational.stationary_distribution(replace(matrix, data=rationals(matrix.data.tolist())))
    found = stationary.stationary_distribution(matrix, Accuracy())
    for s in range(n):
        assert Fraction(float(found.lower[s])) <= exact[s] <= Fraction(float(found.upper[s]))
    assert np.all(found.upper - found.lower <= 1e-10 * found.upper)
    rewards = np.arange(n) - 2.0
    average = stationary.long_run_average(matrix, rewards, Accuracy())
    value = sum((Fraction(float(r)) * p for r, p in zip(rewards, exact, strict=True)), Fraction(0))
    assert Fraction(average.lower) <= value <= Fraction(average.upper)


def queue(n: int, arrive: float, serve: float) -> SparseMatrix:
    rates = np.zeros((n, n))
    rates[np.arange(n - 1), np.arange(1, n)] = arrive
    rates[np.arange(1, n), np.arange(n - 1)] = serve
    return sparse_of(rates)


def test_a_queue_keeps_the_digits_of_rare_states() -> None:
    n, arrive, serve = 400, 1.0, 4.0
    found = stationary.stationary_distribution(queue(n, arrive, serve), Accuracy())
    exact = 0.75 * 0.25 ** np.arange(n)
    assert np.all(np.abs(found.middle - exact) <= 1e-9 * exact)
    assert found.certified


def test_a_queue_that_is_overloaded_keeps_its_weights_within_the_range_of_doubles() -> None:
    """4^600 is no double: the states that are eliminated first are those that matter."""
    n, arrive, serve = 600, 4.0, 1.0
    found = stationary.stationary_distribution(queue(n, arrive, serve), Accuracy())
    exact = 0.75 * 0.25 ** np.arange(n)[::-1]
    assert found.certified
    normal = exact > 1e-300
    assert np.all(np.abs(found.middle - exact)[normal] <= 1e-9 * exact[normal])
    assert np.all(found.upper[~normal] <= 1e-299)


def test_two_parts_beyond_states_rarer_than_any_double_have_their_weights() -> None:
    """The way between the parts has the probability 10^-400."""
    n = 81
    rates = np.zeros((n, n))
    up = np.where(np.arange(n - 1) < n // 2, 1e-10, 1.0)
    rates[np.arange(n - 1), np.arange(1, n)] = up
    rates[np.arange(1, n), np.arange(n - 1)] = np.where(up < 1, 1.0, 1e-10)
    found = stationary.stationary_distribution(sparse_of(rates), Accuracy())
    assert found.certified
    assert found.middle[[0, n - 1]] == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize(("arrive", "serve"), [(1.0, 4.0), (4.0, 5.0)])
def test_averages_by_the_poisson_equation(
    monkeypatch: pytest.MonkeyPatch, arrive: float, serve: float
) -> None:
    """More states than elimination is asked for at once; two queues side by side, one reward each."""
    m = 60
    one = queue(m, arrive, serve)
    dense = np.zeros((m, m))
    dense[np.repeat(np.arange(m), np.diff(one.indptr)), one.indices] = one.data
    identity = np.eye(m)
    both = sparse_of(np.kron(dense, identity) + np.kron(identity, dense))
    length = np.add.outer(np.arange(m), np.arange(m)).ravel().astype(float)
    monkeypatch.setattr(tuning, "QUICK_OPERATIONS_PER_ENTRY", 0)
    average = stationary.long_run_average(both, length, Accuracy())
    weights = (arrive / serve) ** np.arange(m)
    exact = 2 * float(weights @ np.arange(m)) / float(weights.sum())
    assert "Poisson" in average.explanation
    assert average.lower <= exact <= average.upper
    assert average.upper - average.lower <= 1e-6 * average.upper


def test_large_chains_give_an_estimate_when_elimination_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tuning, "STATIONARY_OPERATIONS", 10)
    found = stationary.stationary_distribution(queue(50, 1.0, 2.0), Accuracy())
    assert not found.certified
    assert found.middle[0] == pytest.approx(0.5, rel=1e-4)


@settings(max_examples=100, deadline=None)
@given(st.integers(2, 12), st.integers(0, 2**32 - 1))
def test_elimination_has_the_relative_accuracy_that_it_claims(n: int, seed: int) -> None:
    """Leaving is as rare as 1e-14: the solution is right to the bound, where ordinary elimination has no digit."""
    rng = np.random.default_rng(seed)
    weights = rng.integers(0, 4, (n, n)) * 0.125
    np.fill_diagonal(weights, 0.0)
    weights += 0.125 * np.roll(np.eye(n), 1, axis=1)
    leave = np.zeros(n)
    leave[0] = 2.0**-46
    matrix = sparse_of(weights)
    factors = GthElimination(matrix.indptr, matrix.indices, matrix.data, leave, 10**9)
    right = np.zeros(n)
    right[n - 1] = 1.0
    found = factors.solve(right)
    # The same in fractions: diag(row sums + leave) - weights.
    rows = [[-Fraction(w) for w in row] for row in weights]
    for i in range(n):
        rows[i][i] = sum((Fraction(w) for w in weights[i]), Fraction(0)) + Fraction(leave[i])
    augmented = [[*row, Fraction(right[i])] for i, row in enumerate(rows)]
    for c in range(n):
        pivot = next(r for r in range(c, n) if augmented[r][c])
        augmented[c], augmented[pivot] = augmented[pivot], augmented[c]
        augmented[c] = [v / augmented[c][c] for v in augmented[c]]
        for r in range(n):
            if r != c and augmented[r][c]:
                augmented[r] = [
                    a - augmented[r][c] * b for a, b in zip(augmented[r], augmented[c], strict=True)
                ]
    for s in range(n):
        exact = augmented[s][n]
        assert abs(Fraction(float(found[s])) - exact) <= Fraction(factors.error) * exact


@pytest.mark.parametrize("n", [50, 300])
def test_a_queue_that_no_elimination_is_tried_on(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chain that drifts to one end mixes slowly from the other: the Poisson equation is solved all the same."""
    monkeypatch.setattr(tuning, "QUICK_OPERATIONS_PER_ENTRY", 0)
    monkeypatch.setattr(tuning, "STATIONARY_OPERATIONS", 0)
    k = np.arange(n)
    indptr = np.concatenate(([0], np.cumsum(2 - ((k == 0) | (k == n - 1))))).astype(np.int64)
    pairs = [(a, r) for s in range(n) for a, r in ((s - 1, 1.0), (s + 1, 1.5)) if 0 <= a < n]
    matrix = SparseMatrix(
        indptr, np.array([a for a, _ in pairs], np.int32), np.array([r for _, r in pairs]), n
    )
    found = stationary.long_run_average(matrix, (n - 1.0) - k, Accuracy())
    assert "BiCGStab" in found.explanation
    weights = (1.0 / 1.5) ** np.arange(n)  # of the queue with arrivals at rate 1 and service at 1.5
    assert found.lower <= weights @ np.arange(n) / weights.sum() <= found.upper
    assert found.upper - found.lower <= 1e-6 * found.upper
