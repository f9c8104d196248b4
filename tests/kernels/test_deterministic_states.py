"""Loops over forced states, against what they are defined to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from symcheck.kernels.graph import deterministic_states
from symcheck.kernels.rows import sparse

N = 12
places = st.lists(st.integers(-N, 3), min_size=N, max_size=N)
matrices = st.lists(
    st.lists(st.sampled_from([0.0, 0.0, 0.25, 0.5]), min_size=5, max_size=5), min_size=4, max_size=4
)


def rows_of(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    indptr = np.concatenate(([0], np.cumsum((dense > 0).sum(axis=1)))).astype(np.int64)
    return indptr, np.nonzero(dense)[1].astype(np.int32), dense[dense > 0]


def dense_of(indptr: np.ndarray, indices: np.ndarray, data: np.ndarray, columns: int) -> np.ndarray:
    out = np.zeros((len(indptr) - 1, columns))
    for row in range(len(indptr) - 1):
        for k in range(indptr[row], indptr[row + 1]):
            assert out[row, indices[k]] == 0  # no column twice
            out[row, indices[k]] = data[k]
    return out


def end(place: Sequence[int], state: int) -> int:
    for _ in range(N + 1):
        if place[state] >= 0:
            return place[state]
        state = -1 - place[state]
    return 99


@given(places)
def test_following_forced_states(place: list[int]) -> None:
    found = np.array(place, np.int32)
    deterministic_states.resolve_representatives(found, 99)
    assert found.tolist() == [end(place, s) for s in range(N)]


def test_long_ways_are_followed() -> None:
    place = -2 - np.arange(5000, dtype=np.int32)
    place[-1] = 7
    deterministic_states.resolve_representatives(place, 99)
    assert set(place.tolist()) == {7}


@given(matrices, st.lists(st.integers(0, 2), min_size=5, max_size=5))
def test_merging_columns(matrix: list[list[float]], place: list[int]) -> None:
    dense = np.array(matrix)
    indptr, indices, data = rows_of(dense)
    entries = sparse.merge_columns_in_place(indptr, indices, data, np.array(place, np.int32), 3)
    expected = np.zeros((4, 3))
    for column, to in enumerate(place):
        expected[:, to] += dense[:, column]
    assert entries == indptr[-1]
    assert np.array_equal(dense_of(indptr, indices, data, 3), expected)


@given(places, st.lists(st.integers(0, 5), min_size=N, max_size=N))
def test_adding_up_along_forced_ways(place: list[int], earned: list[int]) -> None:
    found, along = np.array(place, np.int32), np.where(np.array(place) < 0, earned, 0).astype(float)
    deterministic_states.resolve_representatives(found, 99, along)
    for start in range(N):
        total, state = 0, start
        while found[start] != 99 and place[state] < 0:
            total, state = total + earned[state], -1 - place[state]
        assert found[start] == 99 or along[start] == total


@given(
    matrices,
    st.lists(st.sampled_from("oyn"), min_size=5, max_size=5),
    st.sets(st.integers(0, 4), max_size=2),
)
def test_rows_of_unknowns(matrix: list[list[float]], kinds: list[str], cuts: set[int]) -> None:
    """Three states with rows of their own, of which some have none, and two without."""
    groups = np.array([0, *sorted([*cuts, 4, 4][:2]), 4, 4, 4], np.int64)
    dense, kind = np.array(matrix), np.array(kinds)
    unknown = kind == "o"
    place = np.where(unknown, np.cumsum(unknown) - 1, -1).astype(np.int32)
    indptr, indices, data = rows_of(dense)
    yes = (kind == "y").astype(np.uint8)
    new, into, leave, entries = deterministic_states.restrict_in_place(
        indptr, indices, data, groups, yes, place, int(unknown.sum())
    )
    rows = [r for s in range(5) if unknown[s] for r in range(groups[s], groups[s + 1])]
    assert np.diff(new).tolist() == np.diff(groups)[unknown].tolist()
    assert np.array_equal(into, dense[rows][:, kind == "y"].sum(axis=1))
    assert np.array_equal(leave, dense[rows][:, ~unknown].sum(axis=1))
    own = dense_of(indptr[: len(rows) + 1], indices[:entries], data[:entries], int(unknown.sum()))
    assert np.array_equal(own, dense[rows][:, unknown])
