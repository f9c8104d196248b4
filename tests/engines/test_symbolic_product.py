"""Products on diagrams against products of the explicit engine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from engines.twins import MODELS, Pair, explicit, pairs, symbolic
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.forms import HybridEngine
from symcheck.semantics.rewards import Structure


@dataclass(frozen=True)
class Table:
    table: np.ndarray
    initial: int


def automaton(seed: int, states: int, letters: int) -> Table:
    rng = np.random.default_rng(seed)
    return Table(
        rng.integers(0, states, (states, 2**letters)).astype(np.int32), int(rng.integers(0, states))
    )


def keys_of(
    engine: ExplicitEngine | SymbolicEngine, second: list[np.ndarray]
) -> list[tuple[object, ...]]:
    """Each pair's valuation and automaton state (`second`: membership by automaton state), in the
    engine's order.
    """
    states = list(engine.valuations(engine.all))
    automaton_state = np.argmax(np.array(second), axis=0)
    return [(*v, int(q)) for v, q in zip(states, automaton_state, strict=True)]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_products_agree(name: str, size: int) -> None:
    a, b = explicit(name), symbolic(name, HybridEngine)
    letters: list[Pair] = list(pairs(name, 2, HybridEngine))
    table = automaton(size, size, 2)
    p = a.product([x.array for x in letters], table)
    q = b.product([x.diagram for x in letters], table)
    assert (p.engine.states, p.engine.transitions, p.engine.choices) == (
        q.engine.states,
        q.engine.transitions,
        q.engine.choices,
    )
    left = keys_of(
        p.engine, [p.engine.to_bools(p.automaton_states(frozenset({i}))) for i in range(size)]
    )
    right = keys_of(
        q.engine, [q.engine.to_bools(q.automaton_states(frozenset({i}))) for i in range(size)]
    )
    assert sorted(left) == sorted(right)
    place = {key: i for i, key in enumerate(right)}
    order = np.array(
        [place[key] for key in left]
    )  # number in the symbolic product of each explicit pair

    def same(found: object, expected: object) -> bool:
        return np.array_equal(q.engine.to_bools(found)[order], p.engine.to_bools(expected))

    edges = frozenset({(0, 1), (size - 1, 3), (0, 0)})
    assert same(q.edges(edges), p.edges(edges))
    assert same(q.engine.initial, p.engine.initial)
    assert same(q.engine.deadlocks, p.engine.deadlocks)
    for x in letters:
        assert same(q.lift(x.diagram), p.lift(x.array))
        assert same(
            q.engine.graph.predecessors(q.lift(x.diagram)),
            p.engine.graph.predecessors(p.lift(x.array)),
        )
    rng = np.random.default_rng(1)
    members = rng.random(p.engine.states) < 0.4
    scattered = np.zeros_like(members)
    scattered[order] = members
    one, two = p.engine.from_bools(members), q.engine.from_bools(scattered)
    assert np.array_equal(b.to_bools(q.project_set(two)), a.to_bools(p.project_set(one)))
    assert same(q.engine.graph.exists_until(~two, two), p.engine.graph.exists_until(~one, one))

    values = rng.random(p.engine.states)
    moved = np.empty_like(values)
    moved[order] = values
    lifted = p.engine.system(p.engine.all).lift(values, None)
    found = (
        q.engine.system(two)
        .lift(moved[scattered], None)
        .choose(two, q.engine.system(q.engine.all).lift(moved, None))
    )
    np.testing.assert_array_equal(q.project(found).at(b.all), p.project(lifted).at(a.all))
    np.testing.assert_array_equal(
        q.project(q.engine.constant(0.5)).at(b.all), p.project(p.engine.constant(0.5)).at(a.all)
    )

    dense = []
    for engine, numbers in ((p.engine, np.arange(len(order))), (q.engine, order)):
        m = engine.system(engine.all).matrix
        groups = np.arange(m.rows + 1) if m.groups is None else m.groups
        rows = [
            [m.data[m.indptr[r] : m.indptr[r + 1]].sum() for r in range(groups[s], groups[s + 1])]
            for s in numbers
        ]
        total = np.zeros((m.states, m.states))
        owner = np.repeat(np.repeat(np.arange(m.states), np.diff(groups)), np.diff(m.indptr))
        np.add.at(total, (owner, m.indices), m.data)
        dense.append(
            (total[np.ix_(numbers, numbers)], [np.sort(np.round(r, 12)).tolist() for r in rows])
        )
    np.testing.assert_allclose(dense[0][0], dense[1][0], rtol=1e-12)
    assert dense[0][1] == dense[1][1]
    for i in range(len(a.model.rewards)):
        one_rewards = p.engine.system(p.engine.all).rewards(Structure(i))[0]
        np.testing.assert_allclose(
            q.engine.system(q.engine.all).rewards(Structure(i))[0][order], one_rewards, rtol=1e-13
        )


def test_a_product_of_a_product() -> None:
    a, b = explicit("dtmc"), symbolic("dtmc", HybridEngine)
    (first, second) = pairs("dtmc", 2, HybridEngine)
    p = a.product([first.array], automaton(1, 3, 1))
    q = b.product([first.diagram], automaton(1, 3, 1))
    p2 = p.engine.product([p.lift(second.array)], automaton(2, 2, 1))
    q2 = q.engine.product([q.lift(second.diagram)], automaton(2, 2, 1))
    assert (p2.engine.states, p2.engine.transitions) == (q2.engine.states, q2.engine.transitions)
