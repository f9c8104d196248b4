"""Blocks of rows of a triangle: where they begin, which need which, and that threads change no digit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from symcheck.kernels.chains.row_blocks import RowBlocks, bounds_of_blocks, needed_blocks
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix
from symcheck.parallel.threads import use_threads


def grid(width: int, height: int) -> SparseMatrix:
    """Steps to the four neighbours in a grid whose states are numbered row by row."""
    entries = []
    for y in range(height):
        for x in range(width):
            near = ((x, y - 1), (x - 1, y), (x + 1, y), (x, y + 1))
            entries.append([b * width + a for a, b in near if 0 <= a < width and 0 <= b < height])
    indptr = np.cumsum([0, *map(len, entries)])
    indices = np.concatenate(entries).astype(np.int32)
    return SparseMatrix(indptr, indices, 0.1 + 0.1 * (indices % 2), width * height)


def triangle(matrix: SparseMatrix, *, upper: bool) -> tuple[np.ndarray, np.ndarray]:
    """The entries of each row of a triangle, and their columns."""
    rows = matrix.row_of_entry
    chosen = matrix.indices > rows if upper else matrix.indices < rows
    count = np.bincount(rows[chosen], minlength=matrix.states).astype(np.int32)
    return count, matrix.indices[chosen]


@pytest.mark.parametrize("upper", [False, True])
def test_blocks_begin_where_the_fewest_short_entries_lead_across(upper: bool) -> None:
    """Every 13 states include one at which a row of 10 begins; the first ones have few entries."""
    bounds = bounds_of_blocks(*triangle(grid(10, 12), upper=upper), 13)
    assert len(bounds) == 120 // 13 + 1
    assert not np.any(bounds[2:] % 10)
    assert np.all(np.diff(bounds) > 0)


def test_a_block_needs_those_in_which_it_has_entries() -> None:
    count, columns = np.array([0, 1, 1, 0, 2, 1], np.int32), np.array([0, 1, 0, 3, 1], np.int32)
    bounds = np.array([0, 2, 4, 6])
    starts, needed = needed_blocks(count, columns, bounds, 10)
    assert [needed[a:b].tolist() for a, b in pairwise(starts)] == [
        [],
        [0],
        [0, 1],
    ]
    assert needed_blocks(count, columns, bounds, 2) is None


def test_a_chain_has_as_many_levels_as_blocks_and_independent_rows_have_one() -> None:
    line = np.array([0] + [1] * 39, np.int32), np.arange(39, dtype=np.int32)
    chain = RowBlocks(*line, False, 8, 1)
    assert chain.blocks == chain.levels == 8
    free = RowBlocks(np.zeros(40, np.int32), np.empty(0, np.int32), False, 8, 1)
    assert (free.blocks, free.levels) == (8, 1)
    assert RowBlocks(*line, False, 8, 100).blocks == 1
    assert RowBlocks(np.empty(0, np.int32), np.empty(0, np.int32), True, 8, 1).blocks == 1


def test_no_digit_depends_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    matrix = grid(60, 50)
    monkeypatch.setattr(tuning, "THREADED_TRIANGLES", 1)
    monkeypatch.setattr(tuning, "MIN_BLOCK_ROWS", 7)
    right = np.sin(np.arange(matrix.states))
    found = []
    for threads in (1, 2, 3, 4):
        with use_threads(threads):
            split = SplitMatrix.of(matrix, np.full(matrix.states, 1.2))
            assert 1 < split.up[0].levels < split.up[0].blocks
            steps = zip(split.solve(right), range(12), strict=False)
            found.append([(split.solve_upper(x), rest) for (x, rest), _ in steps])
    for steps in found[1:]:
        for (x, rest), (expected, expected_rest) in zip(steps, found[0], strict=True):
            assert np.array_equal(x, expected)
            assert rest == expected_rest
    assert found[0][-1][1] < 1e-3 * found[0][0][1]
