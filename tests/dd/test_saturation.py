"""Saturation computes the least fixpoint that repeated images compute."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd import tuning
from symcheck.dd.manager import Bdd, DiagramManager, Saturation, Transition
from symcheck.dd.saturation import saturate
from symcheck.errors import TimeLimitError

BITS = 5
ROWS = [f"x{i}" for i in range(BITS)]
COLUMNS = [f"{name}'" for name in ROWS]

touched_bits = st.lists(st.integers(0, BITS - 1), unique=True).map(sorted)
seeds = st.integers(0, 2**32 - 1)


def manager_of_pairs() -> DiagramManager:
    manager = DiagramManager()
    manager.add_variables(name for pair in zip(ROWS, COLUMNS, strict=True) for name in pair)
    return manager


def sparse_set(manager: DiagramManager, names: list[str], seed: int, density: float) -> Bdd:
    """A random set over the variables."""
    return manager.bdd_table(names, np.random.default_rng(seed).random(1 << len(names)) < density)


def relation_of(manager: DiagramManager, touched: list[int], seed: int) -> tuple[Bdd, Transition]:
    """Reads any row bit and changes those touched."""
    names = ROWS + [COLUMNS[i] for i in touched]
    return sparse_set(manager, names, seed, 0.08), manager.transition(
        [ROWS[i] for i in touched], [COLUMNS[i] for i in touched]
    )


def repeated(
    relations: list[tuple[Bdd, Transition]], states: Bdd, within: Bdd, forward: bool
) -> Bdd:
    """The least fixpoint by its definition."""
    while True:
        before = states
        for relation, transition in relations:
            step = transition.image if forward else transition.preimage
            states = states | (step(states, relation) & within)
        if states == before:
            return states


def counter(bits: int) -> tuple[DiagramManager, Bdd, tuple[Bdd, Transition]]:
    """x' = x + 1 over so many bits, and the set of 0."""
    manager = DiagramManager()
    rows, columns = [f"b{i}" for i in range(bits)], [f"b{i}'" for i in range(bits)]
    manager.add_variables(name for pair in zip(rows, columns, strict=True) for name in pair)
    relation, carry = manager.true, manager.true
    for row, column in zip(reversed(rows), reversed(columns), strict=True):
        relation = relation & manager.variable(column).equivalent(manager.variable(row) ^ carry)
        carry = carry & manager.variable(row)
    zero = manager.conjunction([~manager.variable(row) for row in rows])
    return manager, zero, (relation - carry, manager.transition(rows, columns))


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(touched_bits, seeds), max_size=4), seeds, seeds, st.booleans(), st.booleans()
)
def test_saturation_is_the_least_fixpoint(kinds, start, border, bounded, forward):
    manager = manager_of_pairs()
    relations = [relation_of(manager, touched, seed) for touched, seed in kinds]
    states = sparse_set(manager, ROWS, start, 0.1)
    within = sparse_set(manager, ROWS, border, 0.6) if bounded else manager.true
    saturation = manager.saturation(relations, forward=forward)
    expected = repeated(relations, states, within, forward)
    assert saturation.saturate(states, within) == expected
    assert saturation.saturate(expected, within) == expected
    assert (
        manager.saturation(relations, forward=forward).saturate(states, within, new_only=True)
        == expected
    )
    manager.core.check()


def test_earlier_results_do_not_change_later_ones():
    manager = manager_of_pairs()
    relations = [relation_of(manager, [0, 3], 1), relation_of(manager, [2], 2)]
    saturation = manager.saturation(relations)
    for seed in range(20):
        states, within = (
            sparse_set(manager, ROWS, seed, 0.05),
            sparse_set(manager, ROWS, seed + 100, 0.7),
        )
        assert saturation.saturate(states) == repeated(relations, states, manager.true, True)
        assert saturation.saturate(states, within) == repeated(relations, states, within, True)
        manager.collect()


def test_a_counter_of_many_bits_needs_few_partitions():
    manager, zero, relation = counter(200)
    saturation = manager.saturation([relation])
    assert saturation.saturate(zero) == manager.true
    assert saturation.partitions <= 201
    backward = manager.saturation([relation], forward=False)
    last = manager.conjunction([manager.variable(f"b{i}") for i in range(200)])
    assert backward.saturate(last) == manager.true


def test_reordering_is_noticed():
    manager = manager_of_pairs()
    relations = [relation_of(manager, [1, 4], 7), relation_of(manager, [0, 2], 8)]
    states = sparse_set(manager, ROWS, 3, 0.1)
    saturation = manager.saturation(relations)
    before = saturation.saturate(states)
    manager.reorder(
        [name for pair in zip(reversed(ROWS), reversed(COLUMNS), strict=True) for name in pair]
    )
    assert saturation.saturate(states) == before
    assert saturation.saturate(before) == before


def far_pairs(n: int) -> tuple[DiagramManager, Bdd, list[tuple[Bdd, Transition]]]:
    """Pairs of bits that become 1 together, far from each other in the order: 2**n nodes for all that come of nothing."""
    manager = DiagramManager()
    rows, columns = [f"b{i}" for i in range(2 * n)], [f"b{i}'" for i in range(2 * n)]
    manager.add_variables(name for pair in zip(rows, columns, strict=True) for name in pair)
    relations = []
    for a in range(n):
        both = manager.variable(columns[a]) & manager.variable(columns[a + n])
        relations.append(
            (both, manager.transition([rows[a], rows[a + n]], [columns[a], columns[a + n]]))
        )
    return manager, manager.conjunction([~manager.variable(row) for row in rows]), relations


def test_a_limit_gives_none():
    manager, nothing, relations = far_pairs(20)
    saturation = manager.saturation(relations)
    assert saturation.saturate(nothing, deadline=time.monotonic() - 1) is None
    assert saturation.saturate(nothing, max_lookups=5000) is None
    few = Saturation(manager.core, relations, max_partitions=3)
    assert few.saturate(nothing) is None
    assert few.exhausted
    assert saturate(few, nothing) is None
    manager.core.check()
    manager.limit_time(0)
    with pytest.raises(TimeLimitError):
        saturation.saturate(nothing)
    manager.limit_time(None)
    assert manager.saturation(relations[:3]).saturate(nothing) == repeated(
        relations[:3], nothing, manager.true, True
    )


def test_the_two_modes_take_turns(monkeypatch):
    monkeypatch.setattr(tuning, "FIRST_LOOKUPS", {True: 2000})
    manager, nothing, relations = far_pairs(12)
    turns = []

    class Watched:
        exhausted, forward = False, True

        def saturate(self, states, within, **limits):
            turns.append((limits["max_lookups"], limits["new_only"]))
            return saturation.saturate(states, within, **limits)

    saturation = manager.saturation(relations)
    assert saturate(Watched(), nothing) == repeated(relations, nothing, manager.true, True)
    assert len(turns) > 2
    assert turns[:3] == [(2000, False), (2000, True), (4000, False)]


def test_columns_must_follow_their_rows():
    manager = DiagramManager()
    manager.add_variables(["a", "b", "a'", "b'"])
    with pytest.raises(ValueError, match="directly below"):
        manager.saturation([(manager.true, manager.transition(["a"], ["a'"]))])
    with pytest.raises(ValueError, match="another manager"):
        manager.saturation([(DiagramManager().true, manager.transition([], []))])
    with pytest.raises(ValueError, match="different managers"):
        manager.saturation([]).saturate(DiagramManager().true)
