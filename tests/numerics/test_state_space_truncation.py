"""What bounds the importance of states is above the true solution, by whichever way it was found."""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.transient import state_space_truncation

REST = 0.05


def slow(n: int, seed: int) -> tuple[Floats, SparseMatrix, Floats, Floats]:
    """A chain without leaks and with rates of several sizes, (rest - Q) in full, and a reward rate in one place."""
    rng = np.random.default_rng(seed)
    rates = np.zeros((n, n))
    for step, fast in ((1, 20.0), (3, 0.5)):
        for sign in (1, -1):
            rates[np.arange(n), (np.arange(n) + sign * step) % n] += fast * rng.random(n)
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    matrix = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], n)
    leave, right = rates.sum(1), np.zeros(n)
    right[0] = 1.0
    return np.diag(leave + REST) - rates, matrix, leave, right


@pytest.mark.parametrize("off", [1.0, 30.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_solution_with_less_rest_is_a_bound_and_not_far_away(seed: int, off: float) -> None:
    full, matrix, leave, right = slow(50, seed)
    truth = np.linalg.solve(full, right)
    guess = truth * off ** np.random.default_rng(seed).uniform(-1.0, 0.0, 50)
    found = state_space_truncation._supersolution(matrix, leave, REST, right, guess)
    assert found is not None
    assert np.all(found >= truth)
    assert np.all(found <= 2.0 * truth)


def test_what_is_below_the_truth_is_not_taken_for_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    full, matrix, leave, right = slow(50, 4)
    truth = np.linalg.solve(full, right)
    monkeypatch.setattr(state_space_truncation, "relative_solution", lambda *_: 0.99 * truth)
    assert state_space_truncation._supersolution(matrix, leave, REST, right, truth) is None


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("first", [1, 600])
def test_the_resolvent_is_bounded_after_few_sweeps_as_after_many(
    transposed: bool, first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "GUESS_SWEEPS", first)
    haste, time = 2.0, 2.0 / REST
    full, matrix, leave, right = slow(50, 5)
    truth = np.exp(haste) * np.linalg.solve(full.T if transposed else full, right)
    found = state_space_truncation._resolvent(matrix, leave, time, right, haste, transposed)
    assert found is not None
    assert np.all(found >= truth)
    assert np.all(found <= 3.0 * truth)
