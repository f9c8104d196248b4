"""Closing sets under relations node by node gives what images, repeated until nothing is new, give."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd import saturation
from symcheck.dd.manager import Bdd, Closure, DiagramManager, Transition
from symcheck.dd.saturation import close
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
    """The same by definition."""
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
def test_closing_is_repeating(kinds, start, border, bounded, forward):
    manager = manager_of_pairs()
    relations = [relation_of(manager, touched, seed) for touched, seed in kinds]
    states = sparse_set(manager, ROWS, start, 0.1)
    within = sparse_set(manager, ROWS, border, 0.6) if bounded else manager.true
    closure = manager.closure(relations, forward=forward)
    expected = repeated(relations, states, within, forward)
    assert closure.close(states, within) == expected
    assert closure.close(expected, within) == expected
    assert manager.closure(relations, forward=forward).close(states, within, fresh=True) == expected
    manager.core.check()


def test_what_was_closed_before_helps_and_does_not_disturb():
    manager = manager_of_pairs()
    relations = [relation_of(manager, [0, 3], 1), relation_of(manager, [2], 2)]
    closure = manager.closure(relations)
    for seed in range(20):
        states, within = (
            sparse_set(manager, ROWS, seed, 0.05),
            sparse_set(manager, ROWS, seed + 100, 0.7),
        )
        assert closure.close(states) == repeated(relations, states, manager.true, True)
        assert closure.close(states, within) == repeated(relations, states, within, True)
        manager.collect()


def test_a_counter_of_many_bits_needs_few_families():
    manager, zero, relation = counter(200)
    closure = manager.closure([relation])
    assert closure.close(zero).is_true
    assert closure.families <= 201
    backward = manager.closure([relation], forward=False)
    last = manager.conjunction([manager.variable(f"b{i}") for i in range(200)])
    assert backward.close(last).is_true


def test_another_order_of_the_variables_is_noticed():
    manager = manager_of_pairs()
    relations = [relation_of(manager, [1, 4], 7), relation_of(manager, [0, 2], 8)]
    states = sparse_set(manager, ROWS, 3, 0.1)
    closure = manager.closure(relations)
    before = closure.close(states)
    manager.reorder(
        [name for pair in zip(reversed(ROWS), reversed(COLUMNS), strict=True) for name in pair]
    )
    assert closure.close(states) == before
    assert closure.close(before) == before


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


def test_giving_up_is_not_an_error():
    manager, nothing, relations = far_pairs(20)
    closure = manager.closure(relations)
    assert closure.close(nothing, nodes=20_000) is None
    assert closure.close(nothing, deadline=time.monotonic() - 1) is None
    assert closure.close(nothing, steps=5000) is None
    few = Closure(manager.core, relations, families=3)
    assert few.close(nothing) is None
    assert few.exhausted
    assert close(few, nothing) is None
    manager.core.check()
    manager.limit_time(0)
    with pytest.raises(TimeLimitError):
        closure.close(nothing)
    manager.limit_time(None)
    assert manager.closure(relations[:3]).close(nothing) == repeated(
        relations[:3], nothing, manager.true, True
    )


def test_two_ways_take_turns(monkeypatch):
    monkeypatch.setattr(saturation, "FIRST", {True: 2000})
    manager, nothing, relations = far_pairs(12)
    turns = []

    class Watched:
        exhausted, forward = False, True

        def close(self, states, within, **limits):
            turns.append((limits["steps"], limits["fresh"]))
            return closure.close(states, within, **limits)

    closure = manager.closure(relations)
    assert close(Watched(), nothing) == repeated(relations, nothing, manager.true, True)
    assert len(turns) > 2
    assert turns[:3] == [(2000, False), (2000, True), (4000, False)]


def test_a_deadline_ends_the_turns(monkeypatch):
    monkeypatch.setattr(saturation, "FIRST", {True: 2000})
    manager, nothing, relations = far_pairs(12)
    closure = manager.closure(relations)

    class Slow:
        exhausted, forward = False, True

        def close(self, states, within, **limits):
            return closure.close(states, within, **limits) if limits["steps"] < 2000 else None

    assert close(Slow(), nothing, deadline=time.monotonic() - 1) is None


def test_columns_must_follow_their_rows():
    manager = DiagramManager()
    manager.add_variables(["a", "b", "a'", "b'"])
    with pytest.raises(ValueError, match="right below"):
        manager.closure([(manager.true, manager.transition(["a"], ["a'"]))])
    with pytest.raises(ValueError, match="another manager"):
        manager.closure([(DiagramManager().true, manager.transition([], []))])
    with pytest.raises(ValueError, match="different managers"):
        manager.closure([]).close(DiagramManager().true)
