"""Rows and blocks of real diagrams, with choices, against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd.manager import DiagramManager, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.kernels.blocks.block_matrix import BlockOperations
from symcheck.matrices.blocks import BlockMatrix, RowLayout, blocks, flatten, quad_dag
from symcheck.matrices.operators import BoundStep

K = 4
N = 2**K
ROWS = [f"r{i}" for i in range(K)]
COLUMNS = [f"c{i}" for i in range(K)]


def build(
    seed: int, classes: int
) -> tuple[list[Mtbdd], list[np.ndarray], Odd, Odd, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    m = DiagramManager()
    m.add_variables(name for pair in zip(ROWS, COLUMNS, strict=True) for name in pair)
    rows, columns = rng.random(N) < 0.7, rng.random(N) < 0.6
    dense = [rng.integers(1, 4, (N, N)) / 7 * (rng.random((N, N)) < 0.3) for _ in range(classes)]
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
    dag = quad_dag(diagrams, row, column, COLUMNS)
    np.testing.assert_array_equal(to_dense(flatten(dag), column.count), dense)
    matrix = blocks(dag, budget=5)
    assert matrix.shape == dense.shape
    assert matrix.entries == np.count_nonzero(dense)
    x = np.random.default_rng(seed).random(column.count)
    np.testing.assert_allclose(matrix.multiply(x), dense @ x)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_choices_are_grouped_by_state(seed: int, classes: int) -> None:
    diagrams, dense, row, column, _, _ = build(seed, classes)
    rng = np.random.default_rng(seed)
    present = [d.any(axis=1) | (rng.random(row.count) < 0.3) for d in dense]
    layout = RowLayout.of(present, row.count)
    dag = quad_dag(diagrams, row, column, COLUMNS)
    stacked, owners = [], []
    for s in range(row.count):
        for choice_class in range(classes):
            if present[choice_class][s]:
                stacked.append(dense[choice_class][s])
                owners.append((s, choice_class))
    expected = np.array(stacked).reshape(len(stacked), column.count)
    np.testing.assert_array_equal(to_dense(flatten(dag, layout), column.count), expected)
    bits = np.unpackbits(layout.present, axis=1, bitorder="little")
    assert owners == [(s, c) for s in range(row.count) for c in range(classes) if bits[c, s]]
    assert np.repeat(np.arange(row.count), np.diff(layout.groups)).tolist() == [
        s for s, _ in owners
    ]

    matrix = blocks(dag, layout)
    x, divisor = rng.random(column.count), rng.random(len(owners)) + 0.5
    np.testing.assert_allclose(matrix.multiply(x), expected @ x)
    np.testing.assert_allclose(matrix.divided(divisor).multiply(x), expected @ x / divisor)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.sampled_from([1, 3, 32768]), st.booleans())
def test_sweeps_keep_bounds_and_close_in(
    seed: int, classes: int, range_rows: int, forward: bool
) -> None:
    """x = opt(A x + b) with rows that sum to less than 1: bounds stay bounds, get tighter, and
    meet.
    """
    diagrams, _, row, _, _, _ = build(seed, classes)
    rng = np.random.default_rng(seed)
    if forward:  # no cycles: one sweep is enough
        diagrams = [
            d * row.manager.table(ROWS + COLUMNS, np.triu(np.ones((N, N)), 1).reshape(-1))
            for d in diagrams
        ]
    present = [np.ones(row.count, bool)] + [rng.random(row.count) < 0.5 for _ in range(classes - 1)]
    guards = [row.from_mask(p) for p in present]
    diagrams = [d.times_bdd(g) * (0.9 / N) for d, g in zip(diagrams, guards, strict=True)]
    dag = quad_dag(diagrams, row, row, COLUMNS)
    layout = RowLayout.of(present, row.count) if classes > 1 else None
    matrix = BlockMatrix(BlockOperations(dag, 5, range_rows=range_rows), layout)
    full = to_dense(flatten(dag, layout), row.count)
    divisor = rng.random(len(full)) + 0.5 if seed % 2 else None
    matrix = matrix if divisor is None else matrix.divided(divisor)
    b = rng.random(len(full)) * 0.05
    groups = layout.groups[:-1] if layout else np.arange(row.count)
    direction = ("min", "max")[seed % 2] if layout else None
    pick = np.maximum if direction == "max" else np.minimum

    def step(x: np.ndarray) -> np.ndarray:
        product = full @ x if divisor is None else full @ x / divisor
        return pick.reduceat(product + b, groups) if len(groups) else x

    truth = np.zeros(row.count)
    for _ in range(3000):
        truth = step(truth)
    lower, upper = np.zeros(row.count), np.full(row.count, 10.0)
    for sweep in range(400):
        before = lower.copy(), upper.copy()
        matrix.sweep(lower, BoundStep(b, direction, 1e-14, upper=False))
        matrix.sweep(upper, BoundStep(b, direction, 1e-14, upper=True))
        assert (lower >= before[0]).all()
        assert (upper <= before[1]).all()
        assert (lower <= truth * (1 + 1e-12)).all()
        assert (upper >= truth * (1 - 1e-12)).all()
        if forward and sweep == 0:
            break
    np.testing.assert_allclose(lower, truth, rtol=1e-11)
    np.testing.assert_allclose(upper, truth, rtol=1e-11)


def test_threads_do_not_change_a_digit(monkeypatch: pytest.MonkeyPatch) -> None:
    diagrams, _, row, column, _, _ = build(5, 3)
    dag = quad_dag(diagrams, row, column, COLUMNS)
    layout = RowLayout.of([np.ones(row.count, bool)] * 3, row.count)
    operations = BlockOperations(dag, 5, range_rows=2)
    x = np.random.default_rng(1).random(column.count)
    one = BlockMatrix(operations, layout).multiply(x)
    monkeypatch.setattr("symcheck.matrices.tuning.MIN_THREADED_ENTRIES", 0)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: range(3))
    assert BlockMatrix(operations, layout).multiply(x).tobytes() == one.tobytes()


def test_entries_outside_of_the_layout_are_refused() -> None:
    diagrams, _, row, column, _, _ = build(1, 1)
    layout = RowLayout.of([np.zeros(row.count, bool)], row.count)
    with pytest.raises(ValueError, match="leaves out"):
        flatten(quad_dag(diagrams, row, column, COLUMNS), layout)


def test_bits_must_alternate() -> None:
    diagrams, _, row, column, _, _ = build(1, 1)
    row.manager.reorder(ROWS + COLUMNS)
    with pytest.raises(ValueError, match="alternate"):
        quad_dag(diagrams, row, column, COLUMNS)
