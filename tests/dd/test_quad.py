"""Rows and blocks of real diagrams, with choices, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd import quad
from symcheck.dd.manager import DiagramManager, Mtbdd
from symcheck.dd.odd import Odd

K = 4
N = 2**K
ROWS = [f"r{i}" for i in range(K)]
COLUMNS = [f"c{i}" for i in range(K)]


def build(seed: int, slots: int) -> tuple[list[Mtbdd], list[np.ndarray], Odd, Odd, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    m = DiagramManager()
    m.add_variables(name for pair in zip(ROWS, COLUMNS, strict=True) for name in pair)
    rows, columns = rng.random(N) < 0.7, rng.random(N) < 0.6
    dense = [rng.integers(1, 4, (N, N)) / 7 * (rng.random((N, N)) < 0.3) for _ in range(slots)]
    dense[0] += np.eye(N)
    diagrams = [m.table(ROWS + COLUMNS, d.reshape(-1)) for d in dense]
    row, column = Odd(m, m.bdd_table(ROWS, rows), ROWS), Odd(m, m.bdd_table(ROWS, columns), ROWS)
    return diagrams, [d[np.ix_(rows, columns)] for d in dense], row, column, rows, columns


def to_dense(rows: tuple[np.ndarray, np.ndarray, np.ndarray], columns: int) -> np.ndarray:
    indptr, indices, data = rows
    out = np.zeros((len(indptr) - 1, columns))
    out[np.repeat(np.arange(len(out)), np.diff(indptr)), indices] = data
    return out


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_one_matrix(seed: int) -> None:
    diagrams, (dense,), row, column, _, _ = build(seed, 1)
    dag = quad.quad_dag(diagrams, row, column, COLUMNS)
    np.testing.assert_array_equal(to_dense(quad.flatten(dag), column.count), dense)
    matrix = quad.blocks(dag, budget=5)
    assert matrix.shape == dense.shape
    assert matrix.entries == np.count_nonzero(dense)
    x, z = np.random.default_rng(seed).random(column.count), np.random.default_rng(seed + 1).random(row.count)
    np.testing.assert_allclose(matrix.multiply(x), dense @ x)
    np.testing.assert_allclose(matrix.multiply_transposed(z), z @ dense)
    np.testing.assert_allclose(matrix.row_sums(), dense.sum(axis=1))


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_choices_are_grouped_by_state(seed: int, slots: int) -> None:
    diagrams, dense, row, column, _, _ = build(seed, slots)
    rng = np.random.default_rng(seed)
    present = [d.any(axis=1) | (rng.random(row.count) < 0.3) for d in dense]
    layout = quad.RowLayout.of(present, row.count)
    dag = quad.quad_dag(diagrams, row, column, COLUMNS)
    stacked, owners = [], []
    for s in range(row.count):
        for slot in range(slots):
            if present[slot][s]:
                stacked.append(dense[slot][s])
                owners.append((s, slot))
    expected = np.array(stacked).reshape(len(stacked), column.count)
    np.testing.assert_array_equal(to_dense(quad.flatten(dag, layout), column.count), expected)
    assert [slot for _, slot in owners] == layout.slots.tolist()
    assert np.repeat(np.arange(row.count), np.diff(layout.groups)).tolist() == [s for s, _ in owners]

    matrix = quad.blocks(dag, layout)
    x, z, b = rng.random(column.count), rng.random(len(owners)), rng.random(len(owners))
    np.testing.assert_allclose(matrix.multiply(x), expected @ x)
    np.testing.assert_allclose(matrix.multiply_transposed(z), z @ expected)
    for direction, pick in (("min", min), ("max", max)):
        best = matrix.optimum(x, b, direction)
        for s in range(row.count):
            mine = [i for i, (state, _) in enumerate(owners) if state == s]
            if mine:
                assert best[s] == pytest.approx(pick((expected @ x + b)[i] for i in mine))


def test_entries_outside_of_the_layout_are_refused() -> None:
    diagrams, _, row, column, _, _ = build(1, 1)
    layout = quad.RowLayout.of([np.zeros(row.count, bool)], row.count)
    with pytest.raises(ValueError, match="leaves out"):
        quad.flatten(quad.quad_dag(diagrams, row, column, COLUMNS), layout)


def test_bits_must_alternate() -> None:
    diagrams, _, row, column, _, _ = build(1, 1)
    row.manager.reorder(ROWS + COLUMNS)
    with pytest.raises(ValueError, match="alternate"):
        quad.quad_dag(diagrams, row, column, COLUMNS)
