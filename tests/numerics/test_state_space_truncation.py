"""What bounds the importance of states is above the true solution."""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.transient import state_space_truncation

REST = 0.05


def slow(n: int, seed: int, loops: float = 0.0) -> tuple[Floats, SparseMatrix, Floats, Floats]:
    """A chain without leaks, with rates of several sizes, (rest - Q) in full, and a reward rate in one place."""
    rng = np.random.default_rng(seed)
    rates = np.zeros((n, n))
    for step, fast in ((1, 20.0), (3, 0.5)):
        for sign in (1, -1):
            rates[np.arange(n), (np.arange(n) + sign * step) % n] += fast * rng.random(n)
    rates[np.arange(n), np.arange(n)] += loops * rng.random(n)
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    matrix = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], n)
    leave, right = rates.sum(1), np.zeros(n)
    right[0] = 1.0
    return np.diag(leave + REST) - rates, matrix, leave, right


@pytest.mark.parametrize("loops", [0.0, 1.0, 1000.0])
@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize("unused", ["_by_sweeps", "_by_bicgstab"])
def test_the_resolvent_is_bounded(
    transposed: bool, loops: float, unused: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(state_space_truncation._Resolvent, unused, lambda _: None)
    shift, time = 2.0, 2.0 / REST
    full, matrix, leave, right = slow(50, 5, loops)
    truth = np.exp(shift) * np.linalg.solve(full.T if transposed else full, right)
    resolvent = state_space_truncation._Resolvent.of(
        matrix, leave, time, shift, right, transposed=transposed
    )
    assert np.all(resolvent.estimate <= truth)
    found = resolvent.upper()
    assert found is not None
    assert np.all(found >= truth)
    assert np.all(found <= 3.0 * truth)


def test_each_order_of_the_states_goes_on_from_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """No order converges within its sweeps, but all of them together do."""
    monkeypatch.setattr(tuning, "TRUNCATION_SOLUTIONS", 0)
    shift, time = 2.0, 2.0 / REST
    full, matrix, leave, right = slow(50, 5)
    truth = np.exp(shift) * np.linalg.solve(full, right)
    for sweeps, enough in (
        ((400, 0, 0, 0), False),
        ((0, 400, 0, 0), False),
        ((400, 400, 400, 400), True),
    ):
        monkeypatch.setattr(tuning, "TRUNCATION_SWEEPS", sweeps)
        found = state_space_truncation._Resolvent.of(matrix, leave, time, shift, right).upper()
        assert (found is not None) is enough
        assert found is None or np.all(found >= truth)


def test_a_solution_that_is_no_bound_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    _, matrix, leave, right = slow(50, 5)
    resolvent = state_space_truncation._Resolvent.of(matrix, leave, 2.0 / REST, 2.0, right)
    found = resolvent._by_bicgstab()
    assert found is not None
    below = found * 0.9
    monkeypatch.setattr(state_space_truncation, "relative_solution", lambda *_, **__: below)
    assert resolvent._by_bicgstab() is None


def test_nothing_is_solved_where_nearly_all_states_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    _, matrix, leave, right = slow(50, 5)
    solved = []
    monkeypatch.setattr(state_space_truncation._Resolvent, "upper", lambda _: solved.append(1))
    for epsilon, matters in ((1e-9, True), (1e9, False)):
        solved.clear()
        found = state_space_truncation.truncate(
            matrix, leave, 2.0 / REST, right, np.array([1]), epsilon, 2.0
        )
        assert found is None
        assert bool(solved) is not matters


def test_no_kept_state_earns_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """0 to 1 to 2, where 2 earns, and 0 to 3, which returns through 4, …, 11. Each of these is rarer than
    3, so that there are rates at which 3 would be kept alone."""
    monkeypatch.setattr(tuning, "TRUNCATION_HOPELESS", 1.0)
    kept = set()
    for rare in np.geomspace(1e-12, 1e-2, 100):
        rates = np.zeros((12, 12))
        rates[0, 1] = rates[1, 2] = rates[2, 0] = rates[0, 3] = 1.0
        rates[3, 4:], rates[4:, 0] = rare, 1.0
        nonzero = rates > 0
        indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
        matrix = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], 12)
        found = state_space_truncation.truncate(
            matrix, rates.sum(1), 1.0, np.eye(12)[2], np.array([0]), 1e-7, 1.0
        )
        assert found is not None
        assert len(found.values) == len(found.kept)
        assert 3 not in found.kept or found.kept[-1] >= 4
        kept.add(len(found.kept))
    assert {3, 12} <= kept
