"""The explicit engine: slices of the matrix, graph questions and products against plain Python."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import engine_of
from generate import random_model
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.errors import InputError, UnsupportedError
from symcheck.syntax.ast import Type
from symcheck.syntax.parse import parse_expression


@st.composite
def engines(draw, kinds=("dtmc", "ctmc", "mdp")):
    model = random_model(Random(draw(st.integers(0, 2**20))), draw(st.sampled_from(kinds)))
    try:
        return engine_of(model.text)
    except (InputError, UnsupportedError):
        assume(False)


def subsets(engine, rng):
    return ArraySet(np.array([rng.random() < 0.5 for _ in range(engine.states)]))


def dense(matrix):
    out = np.zeros((matrix.rows, matrix.columns))
    np.add.at(
        out,
        (np.repeat(np.arange(matrix.rows), np.diff(matrix.indptr)), matrix.indices),
        matrix.data,
    )
    return out


def owners(engine):
    """The state of each row."""
    groups = engine.matrix.groups
    return (
        np.arange(engine.states)
        if groups is None
        else np.repeat(np.arange(engine.states), np.diff(groups))
    )


QUICK = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))


@QUICK
@given(engine=engines(), seed=st.integers(0, 99))
def test_system(engine, seed):
    rng = Random(seed)
    some, target = subsets(engine, rng), subsets(engine, rng)
    system, whole, owner = engine.system(some), dense(engine.matrix), owners(engine)
    rows = some.members[owner]
    assert system.n == some.count
    assert np.array_equal(dense(system.matrix), whole[rows][:, some.members])
    assert system.one_step_probability(target) == pytest.approx(whole[rows] @ target.members)
    assert system.rows == np.count_nonzero(rows)
    if engine.model.type.continuous_time:
        stored = dense(engine.weights)
        assert system.exit_rates == pytest.approx(stored[rows].sum(axis=1))
        assert whole == pytest.approx(stored / stored.sum(axis=1, keepdims=True))
    else:
        assert system.exit_rates is None
        assert engine.matrix is engine.weights
    x = np.arange(1.0, system.n + 1)
    assert system.operator.multiply(x) == pytest.approx(whole[rows][:, some.members] @ x)
    values = engine.indicator(target)
    outside = whole[rows] * ~some.members
    assert system.one_step_values(values)[0] == pytest.approx(outside @ target.members)
    if engine.matrix.groups is not None:
        places = np.searchsorted(np.flatnonzero(some.members), owner[rows])
        assert np.array_equal(np.repeat(np.arange(system.n), np.diff(system.groups)), places)
    lifted = system.lift(x, None, [(target - some, 7.0)], up_to_rounding=True)
    expected = np.where((target - some).members, 7.0, 0.0)
    expected[some.members] = x
    assert (lifted.lower <= expected).all()
    assert (expected <= lifted.upper).all()
    assert lifted.upper == pytest.approx(expected, rel=2e-12)
    assert np.array_equal(lifted.computed, some.members)


@QUICK
@given(engine=engines(), seed=st.integers(0, 99))
def test_graph(engine, seed):
    rng = Random(seed)
    a, b = subsets(engine, rng), subsets(engine, rng)
    owner = owners(engine)
    edges = {
        (int(owner[r]), int(c))
        for r in range(engine.matrix.rows)
        for c in np.flatnonzero(dense(engine.matrix)[r])
    }
    following = {s: {t for u, t in edges if u == s} for s in range(engine.states)}
    assert engine.graph.predecessors(a).members.tolist() == [
        any(a.members[t] for t in following[s]) for s in range(engine.states)
    ]
    assert engine.graph.all_successors_in(a).members.tolist() == [
        all(a.members[t] for t in following[s]) for s in range(engine.states)
    ]
    reach = set(np.flatnonzero(b.members))
    while more := {
        s for s in range(engine.states) if s not in reach and a.members[s] and following[s] & reach
    }:
        reach |= more
    assert engine.graph.exists_until(a, b).members.tolist() == [
        s in reach for s in range(engine.states)
    ]
    stay = set(np.flatnonzero(a.members))
    while less := {s for s in stay if not following[s] & stay}:
        stay -= less
    assert engine.graph.exists_globally(a).members.tolist() == [
        s in stay for s in range(engine.states)
    ]


@QUICK
@given(engine=engines(kinds=("dtmc",)), seed=st.integers(0, 99))
def test_witness(engine, seed):
    target = subsets(engine, Random(seed))
    path = engine.graph.witness(engine.all, target)
    table = list(engine.valuations(engine.all))
    names = [v.name for v in engine.model.variables]
    start = int(np.flatnonzero(engine.initial.members)[0])
    distance, whole = {start: 0}, dense(engine.matrix)
    queue = deque([start])
    while queue:
        s = queue.popleft()
        for t in np.flatnonzero(whole[s]):
            if int(t) not in distance:
                distance[int(t)] = distance[s] + 1
                queue.append(int(t))
    hits = [distance[s] for s in np.flatnonzero(target.members) if s in distance]
    assert (path is None) == (not hits)
    if path is not None:
        indices = [table.index(tuple(state[n] for n in names)) for state in path]
        assert len(path) == min(hits) + 1
        assert indices[0] == start
        assert target.members[indices[-1]]
        assert all(whole[a, b] > 0 for a, b in pairwise(indices))


@dataclass
class Parity:
    """Remembers letter 0 of the last step and whether letter 1 was seen an odd number of times."""

    initial: int = 0

    @property
    def table(self):
        return np.array(
            [[(q >> 1 ^ (v >> 1 & 1)) << 1 | (v & 1) for v in range(4)] for q in range(4)], np.int32
        )


@QUICK
@given(engine=engines(), seed=st.integers(0, 99))
def test_product(engine, seed):
    rng = Random(seed)
    letters = [subsets(engine, rng), subsets(engine, rng)]
    automaton = Parity()
    product = engine.product(letters, automaton)
    letter = [
        int(letters[0].members[s]) + 2 * int(letters[1].members[s]) for s in range(engine.states)
    ]
    groups = (
        engine.matrix.groups if engine.matrix.groups is not None else np.arange(engine.states + 1)
    )
    found, queue = {}, deque((s, 0) for s in range(engine.states))
    while queue:
        s, q = queue.popleft()
        if (s, q) not in found:
            after = int(automaton.table[q, letter[s]])
            rows = [_row(engine.matrix, r, after) for r in range(groups[s], groups[s + 1])]
            found[s, q] = rows
            queue.extend(t for row in rows for t, _ in row)
    pairs = sorted(found)
    matrix = product.engine.matrix
    assert (
        list(zip(product.pairs.state.tolist(), product.pairs.automaton.tolist(), strict=True))
        == pairs
    )
    own = matrix.groups if matrix.groups is not None else np.arange(len(pairs) + 1)
    for p, pair in enumerate(pairs):
        rows = [
            [(pairs[t], w) for t, w in _row(matrix, r, None)] for r in range(own[p], own[p + 1])
        ]
        assert rows == found[pair]
    odd = product.automaton_states(frozenset({2, 3}))
    assert odd.members.tolist() == [q >= 2 for _, q in pairs]
    assert product.lift(letters[0]).members.tolist() == [
        bool(letters[0].members[s]) for s, _ in pairs
    ]
    some = frozenset({(0, 1), (2, 3)})
    assert product.edges(some).members.tolist() == [(q, letter[s]) in some for s, q in pairs]
    numbers = product.engine.system(product.engine.all).lift(np.arange(float(len(pairs))), None)
    assert product.project(numbers).lower.tolist() == [
        pairs.index((s, 0)) for s in range(engine.states)
    ]
    assert product.project_set(odd).members.tolist() == [False] * engine.states
    assert list(product.engine.valuations(product.engine.all)) == [
        list(engine.valuations(engine.all))[s] for s, _ in pairs
    ]


def _row(matrix, r, after):
    """Targets (with the automaton's next state, if one is given) and weights of a row."""
    span = slice(matrix.indptr[r], matrix.indptr[r + 1])
    entries = zip(matrix.indices[span].tolist(), matrix.data[span].tolist(), strict=True)
    return [(t if after is None else (t, after), w) for t, w in entries]


def test_values_and_valuations():
    engine = engine_of(
        "dtmc module m x:[0..2] init 0; b:bool init true; [] x<2 -> (x'=x+1)&(b'=!b); [] x=2 -> true; endmodule"
    )
    assert list(engine.valuations(engine.all)) == [(0, True), (1, False), (2, True)]
    assert list(engine.valuations(engine.all, limit=1)) == [(0, True)]
    assert engine.values(parse_expression("x/2"), Type.DOUBLE).lower.tolist() == [0.0, 0.5, 1.0]
    assert engine.where(parse_expression("b & x>0")).members.tolist() == [False, False, True]
    assert engine.where(parse_expression("true")) == engine.all
    assert list(engine.valuations(engine.first(engine.where(parse_expression("x>0"))))) == [
        (1, False)
    ]
    assert engine.to_bools(engine.from_bools(np.array([True, False, True]))).tolist() == [
        True,
        False,
        True,
    ]
