"""BiCGStab between the triangles of an M-matrix: its steps lead to the solution, however values are stored."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix, _stabilising_step


def chain(n: int, seed: int, values: int | None) -> tuple[Floats, SparseMatrix, Floats]:
    """I - diag(scale) R, R with loops (that do not count) and so many different rates (None: as many as entries), and the scale."""
    rng = np.random.default_rng(seed)
    rates = rng.random((n, n)) if values is None else (1 + rng.integers(values, size=(n, n))) / 7.0
    rates *= rng.random((n, n)) < 0.1
    rates[np.arange(n), np.arange(n)] = 3.0
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    matrix = SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], n)
    scale = 0.95 / rates.sum(1)
    dense = np.eye(n) - scale[:, None] * (rates - np.diag(np.diag(rates)))
    return dense, matrix, scale


@pytest.mark.parametrize("values", [5, None])
@pytest.mark.parametrize("seed", [1, 2])
def test_it_solves_what_elimination_solves(values: int | None, seed: int) -> None:
    dense, matrix, scale = chain(120, seed, values)
    split = SplitMatrix.of(matrix, scale)
    right = np.random.default_rng(seed).normal(size=120)
    x = next(split.solve_upper(x) for x, rest in split.solve(right) if rest <= 1e-12)
    assert np.allclose(x, np.linalg.solve(dense, right), rtol=1e-9, atol=1e-12)
    assert 0 < split.steps < 60


def test_the_triangles_are_inverted() -> None:
    dense, matrix, scale = chain(60, 4, 5)
    split, v = SplitMatrix.of(matrix, scale), np.linspace(1.0, 2.0, 60)
    assert np.allclose(np.tril(dense) @ split.solve_lower(v), v)
    assert np.allclose(np.triu(dense) @ split.solve_upper(v), v)


def test_a_column_times_a_row_may_be_added() -> None:
    dense, matrix, scale = chain(60, 5, 5)
    column, row = np.linspace(0.1, 0.2, 60), np.linspace(0.0, 0.1, 60)
    split = SplitMatrix.of(matrix, scale).with_rank_one(column, row)
    right = np.ones(60)
    x = next(split.solve_upper(x) for x, rest in split.solve(right) if rest <= 1e-12)
    assert np.allclose((dense + np.outer(column, row)) @ x, right)


def test_the_residual_that_is_told_is_the_true_one() -> None:
    dense, matrix, scale = chain(90, 6, 5)
    split, right = SplitMatrix.of(matrix, scale), np.ones(90)
    for x, rest in split.solve(right):
        left = np.linalg.solve(np.tril(dense), right - dense @ split.solve_upper(x))
        assert rest == pytest.approx(np.max(np.abs(left)), abs=1e-13)
        if rest < 1e-9:
            return
    pytest.fail("broke down")


def test_it_goes_on_from_the_true_residual_until_nothing_is_left_to_gain() -> None:
    """More steps than a run of the method is good for lose nothing of what was found."""
    dense, matrix, scale = chain(40, 7, 5)
    split, right = SplitMatrix.of(matrix, scale), np.ones(40)
    x = next(x for x, _ in split.solve(right) if split.steps >= 80)
    assert np.allclose(dense @ split.solve_upper(x), right, atol=1e-13)


def test_steps_are_not_shorter_than_the_angle_allows() -> None:
    assert _stabilising_step(0.9, 1.0, 1.0) == 0.9
    assert _stabilising_step(-0.01, 1.0, 1.0) == pytest.approx(-tuning.MIN_COSINE)
    assert _stabilising_step(0.02, 4.0, 1.0) == pytest.approx(tuning.MIN_COSINE / 2.0)
    assert _stabilising_step(1.0, 0.0, 1.0) == 0.0


def test_values_of_any_size_count_relative_to_their_units() -> None:
    """A solution that falls by 200 orders of magnitude has as many digits everywhere."""
    _, matrix, scale = chain(90, 8, 5)
    unit = 10.0 ** np.linspace(0.0, -200.0, 90)
    matrix = replace(
        matrix, data=matrix.data * np.minimum(unit[matrix.row_of_entry] / unit[matrix.indices], 1.0)
    )
    rates = np.zeros((90, 90))
    rates[matrix.row_of_entry, matrix.indices] = matrix.data
    dense = np.eye(90) - scale[:, None] * (rates - np.diag(np.diag(rates)))
    expected = unit * np.linspace(1.0, 2.0, 90)
    right, split = dense @ expected, SplitMatrix.of(matrix, scale).relative_to(unit)
    x = next(split.solve_upper(x) for x, rest in split.solve(right) if rest <= 1e-12)
    assert np.allclose(x / expected, 1.0, rtol=1e-9)
