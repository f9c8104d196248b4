"""Chosen states of a matrix: sums over their rows, and the matrix among them, against dense arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.kernels.rows.submatrix import select_states, sum_columns
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix

N = 40


def sparse(dense: Floats) -> tuple[Int64s, np.ndarray[tuple[int], np.dtype[np.int32]], Floats]:
    row, column = np.nonzero(dense)
    return (
        np.searchsorted(row, np.arange(len(dense) + 1)).astype(np.int64),
        column.astype(np.int32),
        dense[row, column],
    )


def example(grouped: bool, seed: int) -> tuple[Floats, Int64s | None, Bools, Bools]:
    """A matrix, the rows of each state, chosen states, and which rows are theirs."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, N) if grouped else np.ones(N, np.int64)
    dense = rng.random((int(sizes.sum()), N)) * (rng.random((int(sizes.sum()), N)) < 0.1)
    chosen = rng.random(N) < 0.5
    groups = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64) if grouped else None
    return dense, groups, chosen, np.repeat(chosen, sizes)


@pytest.mark.parametrize("grouped", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_the_matrix_among_chosen_states(grouped: bool, seed: int) -> None:
    dense, groups, chosen, rows = example(grouped, seed)
    found = select_states(*sparse(dense), groups, chosen.view(np.uint8))
    indptr, indices, data = sparse(dense[rows][:, chosen])
    assert np.array_equal(found[0], indptr)
    assert np.array_equal(found[1], indices)
    assert np.array_equal(found[2], data)


@pytest.mark.parametrize("grouped", [False, True])
def test_sums_over_chosen_columns(grouped: bool) -> None:
    dense, groups, chosen, rows = example(grouped, 5)
    values, columns = np.linspace(-1.0, 2.0, N), np.arange(N) % 3 == 0
    matrix = sparse(dense)
    plain = sum_columns(*matrix, groups, chosen.view(np.uint8), columns.view(np.uint8), None)
    weighted = sum_columns(*matrix, groups, chosen.view(np.uint8), columns.view(np.uint8), values)
    assert np.allclose(plain, dense[rows][:, columns].sum(axis=1), rtol=1e-14, atol=0.0)
    assert np.allclose(weighted, dense[rows][:, columns] @ values[columns], rtol=1e-12, atol=1e-15)


def test_columns_left_out_may_have_infinite_values() -> None:
    dense = np.array([[0.5, 0.5], [0.0, 1.0]])
    chosen, columns = np.array([1, 0], np.uint8), np.array([1, 0], np.uint8)
    assert sum_columns(*sparse(dense), None, chosen, columns, np.array([3.0, np.inf])).tolist() == [
        1.5
    ]


def test_what_belongs_to_rows_of_chosen_states() -> None:
    dense, groups, chosen, rows = example(True, 9)
    matrix = SparseMatrix(*sparse(dense), dense.shape[1], groups)
    assert np.array_equal(matrix.rows_of(chosen), rows)
    own = matrix.groups_of(chosen)
    assert groups is not None
    assert own is not None
    assert np.array_equal(np.diff(own), np.diff(groups)[chosen])
    assert own[0] == 0


def test_no_state_is_chosen() -> None:
    dense, groups, _, _ = example(True, 2)
    none = np.zeros(N, np.uint8)
    indptr, indices, data = select_states(*sparse(dense), groups, none)
    assert (indptr.tolist(), len(indices), len(data)) == ([0], 0, 0)
