"""Graph kernels against brute force on small random graphs."""

from __future__ import annotations

from itertools import product as pairs_of

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.kernels.graph import components, mdp_graph, partial_search, product
from symcheck.kernels.rows import sparse

N = 5
edges = st.lists(st.sets(st.integers(0, N - 1), max_size=3), min_size=N, max_size=N)
masks = st.lists(st.booleans(), min_size=N, max_size=N)
choices = st.lists(
    st.lists(st.sets(st.integers(0, N - 1), min_size=1, max_size=2), max_size=3),
    min_size=N,
    max_size=N,
)


def compressed(rows: list[set[int]]) -> tuple[np.ndarray, np.ndarray]:
    indptr = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.int64)
    return indptr, np.array([c for r in rows for c in sorted(r)], np.int32)


def mask(members: list[bool]) -> np.ndarray:
    return np.array(members, np.uint8)


def reaches(rows: list[set[int]], allowed: list[bool]) -> np.ndarray:
    """Which state reaches which by a path whose states before the last are all allowed."""
    out = np.eye(N, dtype=bool)
    for _ in range(N):
        for s in range(N):
            if allowed[s]:
                for t in rows[s]:
                    out[s] |= out[t]
    return out


@given(edges, masks)
def test_components_are_the_classes_of_mutual_reachability(
    rows: list[set[int]], within: list[bool]
) -> None:
    inner = [{t for t in r if within[t]} if within[s] else set() for s, r in enumerate(rows)]
    reached = reaches(inner, within)
    component, order, start = components.components(*compressed(rows), mask(within))
    for s, t in pairs_of(range(N), repeat=2):
        if within[s] and within[t]:
            assert (component[s] == component[t]) == (reached[s, t] and reached[t, s])
            if reached[s, t]:  # successors first
                assert component[t] <= component[s]
        elif not within[s]:
            assert component[s] == -1
    for c in range(len(start) - 1):
        assert set(order[start[c] : start[c + 1]]) == set(np.flatnonzero(component == c))


@given(edges)
def test_bottom_components_have_no_edge_out(rows: list[set[int]]) -> None:
    arrays = compressed(rows)
    component, _, start = components.components(*arrays)
    bottom = components.bottom_components(*arrays, component, len(start) - 1)
    for c in range(len(start) - 1):
        members = set(np.flatnonzero(component == c).tolist())
        assert bool(bottom[c]) == all(rows[s] <= members for s in members)


@given(edges, masks, masks, masks)
def test_reachability_forwards_backwards_and_along_a_shortest_path(
    rows: list[set[int]], sources: list[bool], allowed: list[bool], target: list[bool]
) -> None:
    arrays, reached = compressed(rows), reaches(rows, allowed)
    order, parent = components.breadth_first(*arrays, mask(sources), mask(allowed))
    forward = parent > -2
    assert sorted(order.tolist()) == np.flatnonzero(forward).tolist()
    assert forward.tolist() == [
        any(sources[s] and reached[s, t] for s in range(N)) for t in range(N)
    ]
    transposed = sparse.transpose(*arrays, N)
    no_choices = np.empty(0, np.int32)
    backward = components.backward_reachable(*transposed, no_choices, mask(target), mask(allowed))
    assert backward.tolist() == [
        any(reached[s, t] and target[t] for t in range(N)) for s in range(N)
    ]
    for t in order.tolist():
        assert sources[t] if parent[t] == -1 else t in rows[parent[t]] and allowed[parent[t]]


@given(edges, masks)
def test_breadth_first_order_is_by_distance(rows: list[set[int]], sources: list[bool]) -> None:
    order, parent = components.breadth_first(*compressed(rows), mask(sources))
    distance = {s: 0 for s in range(N) if sources[s]}
    for step in range(N):
        for s in [s for s, d in distance.items() if d == step]:
            for t in rows[s]:
                distance.setdefault(t, step + 1)
    found = [distance[s] for s in order.tolist()]
    assert found == sorted(found)
    assert set(order.tolist()) == set(distance)
    assert all(distance[parent[s]] + 1 == d for s, d in distance.items() if d)


def mdp(states: list[list[set[int]]]) -> tuple[np.ndarray, ...]:
    """indptr, indices, groups, column_ptr, column_rows, row_state."""
    rows = [row for state in states for row in state]
    indptr, indices = compressed(rows)
    groups = np.concatenate([[0], np.cumsum([len(s) for s in states])]).astype(np.int64)
    row_state = np.repeat(np.arange(N, dtype=np.int32), np.diff(groups))
    return indptr, indices, groups, *sparse.transpose(indptr, indices, N), row_state


@given(choices, masks, masks)
def test_the_attractor_is_the_least_fixed_point(
    states: list[list[set[int]]], target: list[bool], allowed: list[bool]
) -> None:
    _, _, groups, *transposed = mdp(states)
    members = {s for s in range(N) if target[s]}
    for _ in range(N):
        members |= {
            s for s in range(N) if allowed[s] and states[s] and all(r & members for r in states[s])
        }
    reached, misses = mask(target), np.diff(groups).astype(np.int32)
    found, hit = np.flatnonzero(reached).astype(np.int32), np.zeros(len(transposed[2]), np.uint8)
    partial_search.search(*transposed, hit, misses, mask(allowed), found, reached)
    assert set(np.flatnonzero(reached)) == members


@given(choices, masks, masks)
def test_almost_sure_reachability_is_the_nested_fixed_point(
    states: list[list[set[int]]], target: list[bool], allowed: list[bool]
) -> None:
    indptr, indices, groups, *transposed = mdp(states)
    outer = set(range(N))
    for _ in range(N + 1):
        inner = {s for s in range(N) if target[s]}
        for _ in range(N):
            inner |= {
                s
                for s in range(N)
                if allowed[s] and any(r <= outer and r & inner for r in states[s])
            }
        outer = inner
    members, witness = mdp_graph.almost_sure_reachability(
        indptr, indices, groups, *transposed, mask(target), mask(allowed)
    )
    assert set(np.flatnonzero(members)) == outer
    rows = [row for state in states for row in state]
    for s in range(N):
        if members[s] and not target[s]:
            assert groups[s] <= witness[s] < groups[s + 1]
            assert rows[witness[s]] <= outer
        else:
            assert witness[s] == -1


@given(choices, masks, st.data())
def test_end_components_are_closed_strongly_connected_and_maximal(
    states: list[list[set[int]]], within: list[bool], data: st.DataObject
) -> None:
    indptr, indices, groups, *transposed = mdp(states)
    rows = [row for state in states for row in state]
    usable = data.draw(st.none() | st.lists(st.booleans(), min_size=len(rows), max_size=len(rows)))
    may_use = np.ones(len(rows), bool) if usable is None else np.array(usable, bool)
    component, enabled, count = mdp_graph.maximal_end_components(
        indptr, indices, groups, *transposed, mask(within), None if usable is None else mask(usable)
    )
    expected: list[set[int]] = []
    pending = [{s for s in range(N) if within[s]}]
    while pending:  # remove states without a row that stays, and split by reachability
        members = pending.pop()
        stays = {
            s: [r for r in range(groups[s], groups[s + 1]) if may_use[r] and rows[r] <= members]
            for s in members
        }
        kept = {s for s in members if stays[s]}
        if kept != members:
            pending += [kept] if kept else []
            continue
        edges_ = [set().union(*(rows[r] for r in stays.get(s, []))) for s in range(N)]
        reached = reaches(edges_, [True] * N)
        classes = {
            frozenset(t for t in members if reached[s, t] and reached[t, s]) for s in members
        }
        if len(classes) == 1:
            expected.append(members)
        else:
            pending += [set(c) for c in classes]
    found = [set(np.flatnonzero(component == c).tolist()) for c in range(count)]
    assert sorted(map(sorted, found)) == sorted(map(sorted, expected))
    for r, row in enumerate(rows):
        s = int(transposed[2][r])
        inside = component[s] >= 0 and all(component[t] == component[s] for t in row)
        assert bool(enabled[r]) == (inside and bool(may_use[r]))


@settings(deadline=None)
@given(edges, st.integers(1, 3), st.data())
def test_the_product_has_the_reachable_pairs(
    rows: list[set[int]], size: int, data: st.DataObject
) -> None:
    state = st.integers(0, size - 1)
    transitions = data.draw(
        st.lists(st.lists(state, min_size=2, max_size=2), min_size=size, max_size=size)
    )
    letters = data.draw(st.lists(st.integers(0, 1), min_size=N, max_size=N))
    indptr, indices = compressed(rows)
    found = np.zeros(N * size, np.uint8)
    table = np.array(transitions, np.int32)
    product.mark_reachable(indptr, indices, table, np.array(letters, np.int32), 0, found)
    pending = [(s, 0) for s in range(N)]
    expected = set(pending)
    while pending:
        s, q = pending.pop()
        for t in rows[s]:
            pair = (t, transitions[q][letters[s]])
            if pair not in expected:
                expected.add(pair)
                pending.append(pair)
    assert set(np.flatnonzero(found)) == {s * size + q for s, q in expected}
    count = int(found.sum())
    parts = np.empty(count, np.int32), np.empty(count, np.int32)
    number = np.empty(len(found), np.int32)
    product.number_pairs(found, size, *parts, number)
    assert list(zip(*(p.tolist() for p in parts), strict=True)) == sorted(expected)
    assert (number >= 0).tolist() == found.astype(bool).tolist()
    base = parts[0].astype(np.int64)
    following = table[parts[1], np.array(letters)[parts[0]]]
    out_indptr = np.concatenate([[0], np.cumsum(np.diff(indptr)[base])]).astype(np.int64)
    out, values = np.empty(out_indptr[-1], np.int32), np.empty(out_indptr[-1])
    weights = np.arange(len(indices), dtype=float)
    product.product_rows(
        indptr, indices, weights, base, following, number, size, out_indptr, out, values
    )
    ordered = sorted(expected)
    for i, (s, q) in enumerate(ordered):
        here = slice(out_indptr[i], out_indptr[i + 1])
        assert [ordered[j] for j in out[here]] == [
            (int(t), transitions[q][letters[s]]) for t in indices[indptr[s] : indptr[s + 1]]
        ]
        assert values[here].tolist() == weights[indptr[s] : indptr[s + 1]].tolist()


@pytest.mark.parametrize(
    ("rows", "answer"),
    [
        ([{1}, {2}, {2}], 1),
        ([{0}, {0, 1}, {1}], -1),
        ([{0}, set(), {2}], 2),
        ([{1}, {0}, set()], 0),
    ],
)
def test_triangular_order(rows: list[set[int]], answer: int) -> None:
    indptr, indices = compressed(rows)
    assert sparse.triangular_order(indptr, indices) == answer


def test_only_edges_among_some_states_count_for_the_order() -> None:
    indptr, indices = compressed([{1, 2}, {0}, {0}])
    assert sparse.triangular_order(indptr, indices) == 0
    assert sparse.triangular_order(indptr, indices, mask([False, True, True])) == 2
