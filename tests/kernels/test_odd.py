"""ODD kernels against brute force over all points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.diagrams import Builder, points
from symcheck.kernels.diagrams import odd, vectors


@st.composite
def sets(draw: st.DrawFn, k: int | None = None) -> tuple[int, np.ndarray]:
    """(k, bool[2**k]) with structure: random, few, nearly all, or a product of two sets."""
    k = draw(st.integers(0, 9)) if k is None else k
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    member = rng.random(2**k) < draw(st.sampled_from([0.02, 0.3, 0.5, 0.98, 1.0, 0.0]))
    if draw(st.booleans()) and k >= 2:
        half = k // 2
        member = np.kron(rng.random(2 ** (k - half)) < 0.6, rng.random(2**half) < 0.5)
    return k, member.astype(bool)


def levels_of(k: int) -> np.ndarray:
    return (3 * np.arange(k) + 1).astype(
        np.int32
    )  # with gaps: rows seldom have all levels to themselves


def odd_of(builder: Builder, root: int, levels: np.ndarray) -> tuple:
    *table, roots = builder.arrays(root)
    return odd.build((*table, roots[0]), levels)


def build(k: int, member: np.ndarray) -> tuple[tuple, Builder, np.ndarray]:
    builder = Builder()
    root = builder.dense(levels_of(k).tolist(), member.astype(float))
    return odd_of(builder, root, levels_of(k)), builder, levels_of(k)


@given(sets())
def test_counts_and_numbers(case: tuple[int, np.ndarray]) -> None:
    k, member = case
    o, _, _ = build(k, member)
    depth, low, high, count, root = o
    assert count[root] == member.sum()
    for node in range(2, len(depth)):
        assert count[node] == count[low[node]] + count[high[node]] > 0
        assert max(low[node], high[node]) < node
        assert all(
            child == 0 or depth[child] == depth[node] + 1 for child in (low[node], high[node])
        )
    bits = points(k)
    expected = np.where(member, np.cumsum(member) - 1, -1)
    ranks = np.empty(2**k, np.int64)
    odd.rank(o, bits, ranks)
    np.testing.assert_array_equal(ranks, expected)
    back = np.empty((member.sum(), k), np.uint8)
    odd.unrank(o, np.arange(member.sum()), back)
    np.testing.assert_array_equal(back, bits[member])


@given(sets(), st.data())
def test_expand_and_collapse_are_inverse(case: tuple[int, np.ndarray], data: st.DataObject) -> None:
    k, member = case
    _, sub = data.draw(sets(k))
    o, builder, levels = build(k, member)
    root = builder.dense(levels.tolist(), sub.astype(float))
    out = np.zeros(member.sum(), np.uint8)
    *table, roots = builder.arrays(root)
    vectors.diagram_to_array(o, (*table, roots[0]), levels, out)
    np.testing.assert_array_equal(out, sub[member])

    level, low, high, croot = vectors.array_to_diagram(o, out, 2, levels, 99)
    # the same, node by node: the diagram of (sub & member) is unique
    again = Builder()
    again.leaf(0)
    again.leaf(1)
    numbers = [0, 1]
    for i in range(2, len(level)):
        numbers.append(again.node(int(level[i]), numbers[low[i]], numbers[high[i]]))
    assert numbers[croot] == again.dense(levels.tolist(), (sub & member).astype(float))


@given(sets(), st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 5, 1000]))
def test_vectors_there_and_back(case: tuple[int, np.ndarray], seed: int, distinct: int) -> None:
    k, member = case
    o, _, levels = build(k, member)
    rng = np.random.default_rng(seed)
    values = np.sort(rng.integers(0, distinct, member.sum())).astype(float) / 7
    if seed % 2:
        rng.shuffle(values)
    ids = np.empty(len(values), np.int32)
    leaves = vectors.number_values(values, ids)
    np.testing.assert_array_equal(leaves[ids], values)
    assert len(set(leaves.tolist())) == len(leaves)
    level, low, high, root = vectors.array_to_diagram(o, ids, len(leaves), levels, 99)
    out = np.zeros(len(values))
    vectors.diagram_to_array(o, (level, low, high, leaves, root), levels, out)
    np.testing.assert_array_equal(out, values)
    assert len(
        set(zip(level[len(leaves) :], low[len(leaves) :], high[len(leaves) :], strict=True))
    ) == len(level) - len(leaves)
    assert (low[len(leaves) :] != high[len(leaves) :]).all()


def test_number_joins_signed_zeros_and_keeps_nan_apart() -> None:
    ids = np.empty(5, np.int32)
    leaves = vectors.number_values(np.array([-0.0, 0.0, np.nan, 1.0, np.inf]), ids)
    assert ids.tolist() == [0, 0, 1, 2, 3]
    assert np.isnan(leaves[1])


def test_a_level_outside_of_the_list_is_refused() -> None:
    builder = Builder()
    root = builder.dense([1, 2], np.array([0.0, 1, 1, 0]))
    with pytest.raises(ValueError, match="levels"):
        odd_of(builder, root, np.array([1], np.int32))
    with pytest.raises(ValueError, match="levels"):
        odd_of(builder, root, np.array([2], np.int32))


def test_huge_sets_are_counted_or_refused() -> None:
    builder = Builder()
    one = builder.leaf(1)
    builder.leaf(0)
    depth, low, high, count, root = odd_of(builder, one, levels_of(62))
    assert count[root] == 2**62
    bits = np.empty((2, 62), np.uint8)
    odd.unrank((depth, low, high, count, root), np.array([0, 2**62 - 1]), bits)
    assert bits[0].sum() == 0
    assert bits[1].sum() == 62
    with pytest.raises(IndexError):
        odd.unrank((depth, low, high, count, root), np.array([2**62]), bits[:1])
    with pytest.raises(OverflowError):
        odd_of(builder, one, levels_of(63))


def test_members_of_a_small_subset_have_numbers_in_a_huge_set() -> None:
    builder = Builder()
    levels = levels_of(60)
    zero, one = builder.leaf(0), builder.leaf(1)
    node = one
    for level in levels[::-1]:  # bits 3, 20 and 41 free, the others 1
        free = level in (levels[3], levels[20], levels[41])
        node = node if free else builder.node(int(level), zero, node)
    sub = odd_of(builder, node, levels)
    bits, expected = np.empty((8, 60), np.uint8), np.ones((8, 60), np.uint8)
    odd.unrank(sub, np.arange(8), bits)
    expected[:, [3, 20, 41]] = points(3)
    np.testing.assert_array_equal(bits, expected)
    out = np.empty(8, np.int64)
    odd.rank(odd_of(builder, one, levels), bits, out)
    assert out.tolist() == [int("".join(map(str, row)), 2) for row in bits]


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_long_blocks_collapse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = 14
    member = np.kron(rng.random(2**7) < 0.7, np.ones(2**7)).astype(bool) & (
        rng.random(2**14) < 0.999
    )
    o, _, levels = build(k, member)
    n = member.sum()
    flags = np.zeros(n, np.uint8)
    edges = np.sort(rng.integers(0, n + 1, 6))
    for a, b in edges.reshape(3, 2):
        flags[a:b] = 1
    level, low, high, root = vectors.array_to_diagram(o, flags, 2, levels, 99)
    out = np.zeros(n, np.uint8)
    vectors.diagram_to_array(o, (level, low, high, np.array([0.0, 1]), root), levels, out)
    np.testing.assert_array_equal(out, flags)
