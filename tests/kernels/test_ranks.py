"""Ranks: some transition of each row lowers them, down to the ends."""

from __future__ import annotations

import numpy as np

from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics.graph import Incidence
from symcheck.numerics.inductive_bounds import progress


def edges() -> Incidence:
    """State 0 goes to 1 or, by its second row, stays; 1 goes to 2; 2 and 3 stay for ever."""
    indptr, indices = np.arange(6), np.array([1, 0, 2, 2, 3], np.int32)
    groups = np.array([0, 2, 3, 4, 5])
    return Incidence(SparseMatrix(indptr, indices, np.ones(5), 4, groups))


def test_one_row_of_a_state_lowers_its_rank() -> None:
    everything, ends = np.ones(5, np.bool_), np.array([False, False, True, False])
    ranks, towards = progress(edges(), everything, ends, all_rows=False)
    assert ranks.tolist() == [2, 1, 0, -1]
    assert towards.tolist() == [0, 2, -1, -1]


def test_all_rows_of_a_state_have_to_lower_its_rank() -> None:
    everything, ends = np.ones(5, np.bool_), np.array([False, False, True, False])
    ranks, _ = progress(edges(), everything, ends, all_rows=True)
    assert ranks.tolist() == [-1, 1, 0, -1]


def test_rows_that_are_not_considered_lower_no_rank() -> None:
    rows, ends = np.array([False, True, True, True, True]), np.array([False, False, True, False])
    ranks, _ = progress(edges(), rows, ends, all_rows=False)
    assert ranks.tolist() == [-1, 1, 0, -1]
