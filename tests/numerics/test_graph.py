"""Graph algorithms against textbook fixed points on random graphs."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.direction import Direction
from symcheck.matrices.rows import Bools, SparseMatrix
from symcheck.numerics import graph

Rows = list[list[tuple[int, ...]]]  # per state, per choice: successors


def matrix_of(rows: Rows, grouped: bool = True) -> SparseMatrix:
    flat = [row for choices in rows for row in choices]
    indptr = np.cumsum([0] + [len(r) for r in flat]).astype(np.int64)
    indices = np.array([c for r in flat for c in r], dtype=np.int32)
    groups = np.cumsum([0] + [len(c) for c in rows]).astype(np.int64)
    return SparseMatrix(
        indptr, indices, np.ones(len(indices)), len(rows), groups if grouped else None
    )


@st.composite
def mdps(draw: st.DrawFn, choices: int = 3) -> tuple[Rows, list[bool], list[bool]]:
    n = draw(st.integers(1, 9))
    row = st.sets(st.integers(0, n - 1), min_size=1, max_size=3).map(lambda s: tuple(sorted(s)))
    rows = draw(st.lists(st.lists(row, min_size=1, max_size=choices), min_size=n, max_size=n))
    mask = st.lists(st.booleans(), min_size=n, max_size=n)
    return rows, draw(mask), draw(mask)


def fixpoint(step, start: set[int]) -> set[int]:  # type: ignore[no-untyped-def]
    while (after := step(start)) != start:
        start = after
    return start


def as_set(mask: Bools) -> set[int]:
    return {int(i) for i in np.flatnonzero(mask)}


def exists_reach(rows: Rows, left: set[int], right: set[int]) -> set[int]:
    return fixpoint(
        lambda y: y | right | {s for s in left if any(set(r) & y for r in rows[s])}, set()
    )


def forced_reach(rows: Rows, left: set[int], right: set[int]) -> set[int]:
    return fixpoint(
        lambda y: y | right | {s for s in left if all(set(r) & y for r in rows[s])}, set()
    )


def almost_sure_reach(rows: Rows, left: set[int], right: set[int]) -> set[int]:
    def inner(x: set[int]) -> set[int]:
        return fixpoint(
            lambda y: (
                y | right | {s for s in left if any(set(r) <= x and set(r) & y for r in rows[s])}
            ),
            set(),
        )

    return fixpoint(inner, set(range(len(rows))))


@settings(max_examples=400, deadline=None)
@given(mdps())
def test_probability_zero_and_one_of_an_mdp(case: tuple[Rows, list[bool], list[bool]]) -> None:
    rows, ls_, rs_ = case
    left, right, everything = np.array(ls_), np.array(rs_), set(range(len(rows)))
    source = graph.Incidence(matrix_of(rows))
    ls, rs = as_set(left), as_set(right)
    assert as_set(graph.prob0(source, left, right)) == everything - exists_reach(rows, ls, rs)
    never = everything - forced_reach(rows, ls, rs)
    assert as_set(graph.prob0(source, left, right, Direction.MIN)) == never
    assert as_set(graph.prob1(source, left, right)) == everything - exists_reach(
        rows, ls - rs, never
    )
    sure, witness = graph.prob1e_strategy(source, left, right)
    assert as_set(sure) == almost_sure_reach(rows, ls, rs)
    flat = [row for choices in rows for row in choices]
    for s in as_set(sure) - rs:
        assert set(flat[witness[s]]) <= as_set(sure)
        assert (
            s
            in np.repeat(np.arange(len(rows)), [len(c) for c in rows])[witness[s] : witness[s] + 1]
        )
    # The witness rows alone reach almost surely.
    chosen: Rows = [[flat[witness[s]]] if witness[s] >= 0 else [(s,)] for s in range(len(rows))]
    assert as_set(sure) <= almost_sure_reach(chosen, ls, rs)


@settings(max_examples=300, deadline=None)
@given(mdps(choices=1))
def test_probability_zero_and_one_of_a_chain(case: tuple[Rows, list[bool], list[bool]]) -> None:
    rows, ls_, rs_ = case
    left, right, everything = np.array(ls_), np.array(rs_), set(range(len(rows)))
    source = matrix_of(rows, grouped=False)
    never = everything - exists_reach(rows, as_set(left), as_set(right))
    assert as_set(graph.prob0(source, left, right)) == never
    assert as_set(graph.prob1(source, left, right)) == everything - exists_reach(
        rows, as_set(left & ~right), never
    )


@settings(max_examples=300, deadline=None)
@given(mdps(choices=1))
def test_components_come_successors_first(case: tuple[Rows, list[bool], list[bool]]) -> None:
    rows, w, _ = case
    inside = as_set(np.array(w))
    reach = {
        s: exists_reach(
            [[tuple(t for t in r if t in inside) for r in c] for c in rows], inside, {s}
        )
        for s in inside
    }
    parts = graph.sccs(matrix_of(rows, grouped=False), np.array(w))
    assert sorted(int(s) for s in parts.order) == sorted(inside)
    for s in inside:
        for t in inside:
            assert (parts.of[s] == parts.of[t]) == (s in reach[t] and t in reach[s])
            if s in reach[t]:
                assert parts.of[t] <= parts.of[s]
    for bottom in graph.bsccs(matrix_of(rows, grouped=False)):
        members = {int(s) for s in bottom}
        assert all(set(r) <= members for s in members for r in rows[s])


@settings(max_examples=400, deadline=None)
@given(mdps())
def test_maximal_end_components(case: tuple[Rows, list[bool], list[bool]]) -> None:
    rows, w, _ = case
    inside = as_set(np.array(w))
    found = graph.maximal_end_components(matrix_of(rows), np.array(w))

    def closed(part: set[int]) -> dict[int, list[tuple[int, ...]]]:
        return {s: [r for r in rows[s] if set(r) <= part] for s in part}

    def is_end_component(part: set[int]) -> bool:
        kept = closed(part)
        if not part or not all(kept.values()):
            return False
        graph_rows: Rows = [list(kept.get(s, [])) for s in range(len(rows))]
        return all(exists_reach(graph_rows, part, {s}) >= part for s in part)

    expected: list[set[int]] = []
    for bits in range(1, 1 << len(inside)):
        part = {s for i, s in enumerate(sorted(inside)) if bits >> i & 1}
        if is_end_component(part):
            expected.append(part)
    maximal = [p for p in expected if not any(p < q for q in expected)]
    assert sorted(map(sorted, maximal)) == sorted(
        sorted(as_set(found.of == c)) for c in range(found.count)
    )
    flat = [(s, row) for s, choices in enumerate(rows) for row in choices]
    for r, (s, row) in enumerate(flat):
        part = as_set(found.of == found.of[s]) if found.of[s] >= 0 else set()
        assert found.rows[r] == (found.of[s] >= 0 and set(row) <= part)


def test_shortest_path() -> None:
    rows: Rows = [[(1, 2)], [(3,)], [(4,)], [(4,)], [(5,)], [(5,)]]
    path = graph.shortest_path(matrix_of(rows, False), np.arange(6) == 0, np.arange(6) == 5)
    assert path is not None
    assert list(path) == [0, 2, 4, 5]
    assert graph.shortest_path(matrix_of(rows, False), np.arange(6) == 5, np.arange(6) == 0) is None


def test_a_cascade_of_removals_takes_linear_time() -> None:
    """State s reaches the target or s-1, and state 1 is stuck: each round of the nested fixed point removes one state."""
    n = 100_000
    rows: Rows = [[(0,)], [(1,)], *[[(0, s - 1)] for s in range(2, n)]]
    everything = np.ones(n, dtype=bool)
    assert not graph.prob1(matrix_of(rows), everything, np.arange(n) == 0, Direction.MAX)[1:].any()
    assert not graph.prob0(matrix_of(rows), everything, np.arange(n) == 0)[2:].any()
