"""The quad-DAG against dense matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.diagrams import Builder
from symcheck.kernels.blocks.block_matrix import BlockOperations
from symcheck.kernels.diagrams import odd
from symcheck.kernels.diagrams.quad_dag import QuadDag


@dataclass
class Case:
    quad: QuadDag
    dense: list[np.ndarray]


def interleave(dense: np.ndarray, k: int) -> np.ndarray:
    """float64[2**k, 2**k] -> float64[4**k] with bits row 0, column 0, row 1, …"""
    axes = [axis for i in range(k) for axis in (i, k + i)]
    return dense.reshape((2,) * (2 * k)).transpose(axes).reshape(-1)


def make(k: int, matrices: list[np.ndarray], rows: np.ndarray, columns: np.ndarray) -> Case:
    builder = Builder()
    row_levels, col_levels = (
        np.arange(1, 3 * k, 3, dtype=np.int32),
        np.arange(2, 3 * k + 1, 3, dtype=np.int32),
    )
    levels = [int(x) for pair in zip(row_levels, col_levels, strict=True) for x in pair]
    row_root = builder.dense(row_levels.tolist(), rows.astype(float))
    col_root = builder.dense(col_levels.tolist(), columns.astype(float))
    roots = [builder.dense(levels, interleave(m, k)) for m in matrices]
    *table, numbers = builder.arrays(row_root, col_root, *roots)
    row = odd.build((*table, numbers[0]), row_levels)
    col = odd.build((*table, numbers[1]), col_levels)
    quad = QuadDag(*table, numbers[2:], row, col, row_levels, col_levels)
    return Case(quad, [m[np.ix_(rows, columns)] for m in matrices])


@st.composite
def cases(draw: st.DrawFn) -> Case:
    k = draw(st.integers(0, 5))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n = 2**k
    values = np.array([0.25, 1 / 3, 2.0, -1.5])
    matrices = []
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["random", "band", "kronecker", "identity", "zero"]))
        if kind == "random":
            m = rng.choice(values, (n, n)) * (
                rng.random((n, n)) < draw(st.sampled_from([0.02, 0.3, 0.9]))
            )
        elif kind == "band":
            m = sum(
                np.diag(np.full(n - abs(d), v), d)
                for d, v in zip((-1, 0, 1, 5), values, strict=True)
                if abs(d) < n
            )
        elif kind == "kronecker":
            half = k // 2
            a, b = rng.choice(values, (2 ** (k - half),) * 2), rng.choice(values, (2**half,) * 2)
            a *= rng.random(a.shape) < 0.4
            b *= rng.random(b.shape) < 0.4
            m = np.kron(a, np.eye(2**half)) + np.kron(np.eye(2 ** (k - half)), b)
        elif kind == "identity":
            m = np.eye(n) * 0.5
        else:
            m = np.zeros((n, n))
        matrices.append(m)
    rows = rng.random(n) < draw(st.sampled_from([0.3, 0.8, 1.0]))
    columns = (
        rows if draw(st.booleans()) else rng.random(n) < draw(st.sampled_from([0.3, 0.8, 1.0]))
    )
    return make(k, matrices, rows, columns)


def flatten(blocks: BlockOperations, root: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    counts = np.zeros(blocks.rows, np.int32)
    blocks.count_entries(root, counts)
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    following = indptr[:-1].copy()
    indices, data = np.empty(indptr[-1], np.int32), np.empty(indptr[-1])
    blocks.fill_rows(root, following, indices, data)
    np.testing.assert_array_equal(following, indptr[1:])
    return indptr, indices, data


@settings(deadline=None)
@given(cases(), st.sampled_from([1, 3, 10, 10**6]))
def test_flattened_rows_are_the_matrix(case: Case, budget: int) -> None:
    blocks = BlockOperations(case.quad, budget, ordered=True)
    for root, dense in enumerate(case.dense):
        indptr, indices, data = flatten(blocks, root)
        r, c = np.nonzero(dense)  # in row order, columns ascending: the very arrays
        np.testing.assert_array_equal(indptr, np.searchsorted(r, np.arange(len(dense) + 1)))
        np.testing.assert_array_equal(indices, c)
        np.testing.assert_array_equal(data, dense[r, c])
        assert case.quad.entries[root] == len(r)


@settings(deadline=None)
@given(
    cases(),
    st.sampled_from([1, 3, 10, 10**6]),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1, 2, 5, 32768]),
)
def test_products(case: Case, budget: int, seed: int, range_rows: int) -> None:
    blocks = BlockOperations(case.quad, budget, range_rows=range_rows)
    assert blocks.range_bounds[0] == 0
    assert blocks.range_bounds[-1] == blocks.rows
    assert (np.diff(blocks.range_bounds) >= 0).all()
    rng = np.random.default_rng(seed)
    for root, dense in enumerate(case.dense):
        x = rng.random(dense.shape[1])
        y = np.ones(dense.shape[0])
        blocks.multiply(root, x, y)
        np.testing.assert_allclose(y, dense @ x, rtol=1e-13, atol=1e-15)


@settings(deadline=None)
@given(cases(), st.integers(0, 2**32 - 1), st.sampled_from([1, 3, 32768]))
def test_choices(case: Case, seed: int, range_rows: int) -> None:
    blocks = BlockOperations(case.quad, 10, range_rows=range_rows)
    rng = np.random.default_rng(seed)
    present = np.array([rng.random(blocks.rows) < 0.7 for _ in case.dense])
    groups = np.concatenate([[0], np.cumsum(present.sum(axis=0))]).astype(np.int64)
    packed = np.packbits(present, axis=1, bitorder="little")
    x = rng.random(blocks.columns)
    expected = np.array(
        [
            m[s] @ x
            for s in range(blocks.rows)
            for m, here in zip(case.dense, present, strict=True)
            if here[s]
        ]
    )
    out = np.empty(groups[-1])
    blocks.multiply_choices(x, groups, packed, out)
    np.testing.assert_allclose(out, expected, rtol=1e-13, atol=1e-15)


def test_parts_do_not_change_a_digit() -> None:
    rng = np.random.default_rng(4)
    k = 8
    m = np.kron(rng.random((16, 16)) < 0.5, np.eye(16)) * 0.3 + np.diag(rng.random(255), 1) * (
        rng.random((256, 256)) < 0.5
    )
    case = make(k, [m], rng.random(2**k) < 0.9, rng.random(2**k) < 0.9)
    x = rng.random(case.dense[0].shape[1])
    results = []
    for first in (True, False):
        blocks = BlockOperations(case.quad, 50, range_rows=20)
        assert blocks.ranges > 5
        y = np.empty(blocks.rows)
        parts = (
            [(0, blocks.ranges)] if first else [(p, p + 1) for p in reversed(range(blocks.ranges))]
        )
        for a, b in parts:
            blocks.multiply(0, x, y, a, b)
        results.append(y)
    assert results[0].tobytes() == results[1].tobytes()


def test_unchanged_variables_are_one_run() -> None:
    k = 8
    rows = np.random.default_rng(1).random(2**k) < 0.7
    case = make(k, [0.5 * np.eye(2**k)], rows, rows)
    blocks = BlockOperations(case.quad, 1)
    assert blocks.statistics["runs"] == blocks.statistics["occurrences"] == 1
    assert blocks.entries.tolist() == [rows.sum()]


def test_repeated_blocks_are_stored_once() -> None:
    k = 8
    rng = np.random.default_rng(1)
    small = rng.random((16, 16)) * (rng.random((16, 16)) < 0.5)
    case = make(
        k, [np.kron(rng.random((16, 16)) < 0.7, small)], np.ones(2**k, bool), np.ones(2**k, bool)
    )
    blocks = BlockOperations(case.quad, 200)
    assert blocks.statistics["runs"] <= np.count_nonzero(small)
    assert blocks.nbytes < 0.1 * 12 * blocks.statistics["entries"]


def test_arrays_of_another_length_are_refused() -> None:
    case = make(2, [np.eye(4)], np.ones(4, bool), np.ones(4, bool))
    blocks = BlockOperations(case.quad, 10)
    with pytest.raises(ValueError, match="rows"):
        blocks.multiply(0, np.zeros(4), np.zeros(3))
    with pytest.raises(IndexError):
        blocks.multiply(1, np.zeros(4), np.zeros(4))
    with pytest.raises(IndexError):
        blocks.multiply(0, np.zeros(4), np.zeros(4), 0, 2)


def test_a_foreign_variable_is_refused() -> None:
    builder = Builder()
    root = builder.dense([0, 1], np.array([0.0, 1, 1, 0]))
    *table, numbers = builder.arrays(root, builder.leaf(1))
    levels = np.array([1], np.int32)
    o = odd.build((*table, numbers[1]), levels)
    with pytest.raises(ValueError, match="neither"):
        QuadDag(*table, numbers[:1], o, o, levels, np.array([2], np.int32))
