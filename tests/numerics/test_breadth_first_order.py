"""The breadth-first order of the states of a graph."""

from __future__ import annotations

import numpy as np

from symcheck.kernels.graph.components import breadth_first_order


def test_breadth_first_order_lists_all_states_by_distance() -> None:
    """0 -> 1 -> 2, and 3 that nobody reaches."""
    indptr, indices = np.array([0, 1, 2, 2, 3], dtype=np.int64), np.array([1, 2, 0], dtype=np.int32)
    assert breadth_first_order(
        indptr, indices, np.array([1, 0, 0, 0], dtype=np.uint8)
    ).tolist() == [
        0,
        1,
        2,
        3,
    ]
    assert breadth_first_order(
        indptr, indices, np.array([0, 0, 1, 0], dtype=np.uint8)
    ).tolist() == [
        2,
        0,
        1,
        3,
    ]
