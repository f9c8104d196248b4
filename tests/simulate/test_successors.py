"""Compiled branches of many states against the interpreter, and sampled paths against the explored model."""

from __future__ import annotations

from itertools import pairwise
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from generate import random_model
from symcheck.errors import ModelFault, NameFault
from symcheck.explicit.build import explore
from symcheck.explicit.states import StateLayout
from symcheck.explicit.successors import SuccessorGenerator
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.interpreter import state_rewards, transitions
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Structure
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.simulate.sources import CommandSource
from symcheck.simulate.stepper import simulate
from symcheck.simulate.steps import CommandSuccessors
from symcheck.syntax.ast import ModelType
from symcheck.syntax.parse import parse_model

KINDS = ("dtmc", "ctmc", "mdp")


def model_of(seed: int, kind: str) -> BoundModel:
    """A random model; some texts are at fault (a reward for an action that no command has), and the next is taken."""
    rng = Random(seed)
    while True:
        try:
            return bind(parse_model(random_model(rng, kind).text), {})
        except NameFault:
            continue


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(KINDS))
def test_successors_are_those_of_the_interpreter(seed: int, kind: str) -> None:
    model = model_of(seed, kind)
    table = explore(model, Options()).states
    states, layout = list(table), table.layout
    generator = SuccessorGenerator(model, layout, Structure(0))
    found, rewards = generator.successors(table.rows), generator.state_rewards(table.rows)
    for i, state in enumerate(states):
        rows = transitions(model, state)
        share = len(rows) or 1  # the choices of an MDP are equally likely
        wanted: dict[tuple[bool | int, ...], float] = {}
        for row in rows:
            for weight, after in row.branches:
                wanted[after] = wanted.get(after, 0.0) + weight / share
        got: dict[tuple[bool | int, ...], float] = {}
        part = slice(int(found.offsets[i]), int(found.offsets[i + 1]))
        for weight, row in zip(found.weights[part].tolist(), found.targets[part], strict=True):
            after = layout.unpack(row)
            got[after] = got.get(after, 0.0) + weight
        assert found.deadlocks[i] == (not rows)
        assert got == pytest.approx(wanted or {state: 1.0})
        earned = float(found.weights[part] @ found.rewards[part])
        assert earned == pytest.approx(sum(r.rewards[0] for r in rows) / share)
        assert rewards[i] == pytest.approx(state_rewards(model, state)[0])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(KINDS))
def test_steps_are_transitions_of_the_explored_model(seed: int, kind: str) -> None:
    model = model_of(seed, kind)
    explored = explore(model, Options())
    matrix = explored.matrix
    path = simulate(CommandSuccessors(model), 40, seed=seed, loop_check=False)
    states = list(explored.states)
    numbers = [states.index(s.state) for s in path]
    assert numbers[0] in explored.initial
    for here, there in pairwise(numbers):
        rows = (
            range(here, here + 1)
            if matrix.groups is None
            else range(matrix.groups[here], matrix.groups[here + 1])
        )
        assert any(there in matrix.indices[matrix.indptr[r] : matrix.indptr[r + 1]] for r in rows)
    assert len(path) == 40 or (path.end == "deadlock" and numbers[-1] in explored.deadlocks)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.sampled_from(KINDS))
def test_a_chain_that_is_dropped_goes_on_alike(seed: int, kind: str) -> None:
    """The chain is dropped at every step where its limit is 0."""
    model = model_of(seed, kind)
    start = np.array([[int(v.initial or 0)] for v in model.variables], np.int64)
    visited = []
    for limit in (0, 1 << 20):
        chain, generator = (
            LazyChain(CommandSource(model), max_branches=limit),
            np.random.default_rng(seed),
        )
        ids = np.repeat(chain.add(chain.source.layout.pack(list(start))), 20)
        states = []
        for _ in range(15):
            ids = chain.expand(ids)
            states.append([chain.source.layout.unpack(row) for row in chain.states(ids)])
            ids, _ = chain.follow(chain.sample(ids, generator.random(len(ids))))
        visited.append(states)
    assert visited[0] == visited[1]


def test_sample_is_the_inverse_of_the_distribution() -> None:
    text = (
        "dtmc module m x:[0..9]; [] x=0 -> "
        + "+".join(f"0.1:(x'={i})" for i in range(10))
        + "; endmodule"
    )
    model = bind(parse_model(text), {})
    chain = LazyChain(CommandSource(model))
    ids = chain.expand(np.repeat(chain.add(chain.source.layout.pack([np.array([0])])), 10))
    targets, _ = chain.follow(chain.sample(ids, np.arange(10) / 10 + 0.05))
    assert [chain.source.layout.unpack(row)[0] for row in chain.states(targets)] == list(range(10))


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("x=1 -> 0.5:(x'=0)", "update-sum"),
        ("x=1 -> (x'=x+5)", "update-range"),
        ("x=1 -> 1.5:(x'=0) + (-0.5):(x'=1)", "update-negative"),
    ],
)
def test_faults_are_those_of_the_interpreter(command: str, code: str) -> None:
    model = bind(
        parse_model(f"dtmc module m x:[0..2]; [] x=0 -> (x'=1); [] {command}; endmodule"), {}
    )
    layout = StateLayout.of(model.variables)
    with pytest.raises(ModelFault) as fault:
        SuccessorGenerator(model, layout).successors(layout.pack([np.array([0, 1, 2])]))
    assert fault.value.diagnostics[0].code == code


def test_sojourn_times_are_exponential() -> None:
    model = bind(
        parse_model(
            "ctmc module m x:[0..1]; [] x=0 -> 3:(x'=1); [] x=0 -> 2:(x'=1); [] x=1 -> 0.25:(x'=0); endmodule"
        ),
        {},
    )
    assert model.type is ModelType.CTMC
    path = simulate(CommandSuccessors(model), 8000, seed=1)
    stays = np.diff(path.times)
    for value, rate in ((0, 5.0), (1, 0.25)):
        own = np.sort(stays[np.array(path.values("x"))[:-1] == value])
        distance = np.abs(1 - np.exp(-rate * own) - np.arange(len(own)) / len(own)).max()
        assert distance < 2.7 / np.sqrt(len(own))  # Kolmogorov: exceeded with probability 1e-6
