"""What a model does, by the plain scalar semantics: small models only."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from symcheck.options import Options
from symcheck.semantics import interpreter
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.build import build
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.symbolic.model import StateSpace, Transitions
from symcheck.symbolic.reachability.search import reach
from symcheck.syntax.ast import ModelType
from symcheck.syntax.parse import parse_model

State = tuple[bool | int, ...]
LOOP = "a deadlock's loop"


def bound(text: str, constants: Mapping[str, object] | None = None) -> BoundModel:
    return bind(parse_model(text), constants or {})


def explore(model: BoundModel) -> dict[State, tuple[interpreter.Row, ...]]:
    """Every reachable state with its rows (none in a deadlock)."""
    found: dict[State, tuple[interpreter.Row, ...]] = {}
    waiting = list(interpreter.initial_states(model))
    while waiting:
        state = waiting.pop()
        if state not in found:
            found[state] = interpreter.transitions(model, state)
            waiting.extend(s for row in found[state] for _, s in row.branches)
    return found


def symbolic(model: BoundModel, schedule: str | None = None, **keywords: object) -> Transitions:
    made = build(model, Options(), **keywords)
    return transitions(reach(made, schedule=schedule), Options())


def states_of(space: StateSpace) -> list[State]:
    return list(space.valuations(space.states))


def at(
    space: StateSpace, diagram: object, state: State, after: State | None = None
) -> float | bool:
    """Value of a diagram at a state, or at a pair of states."""
    encoding, manager = space.symbolic.encoding, space.symbolic.manager
    bits = np.zeros(manager.core.size(), dtype=np.uint8)
    for v in encoding.variables:
        for values, names in ((state, v.rows), (after, v.columns)):
            if values is not None:
                for e, name in enumerate(reversed(names)):
                    bits[manager.index_of(name)] = v.code(values[v.index]) >> e & 1
    return diagram.evaluate(bits)


def assert_same(model: BoundModel, made: Transitions) -> None:
    """The symbolic model has the oracle's states, rows, deadlocks and rewards."""
    expected = explore(model)
    space = made.space
    assert space.count == len(expected)
    order = states_of(space)
    if space.symbolic.encoding.in_declaration_order:
        assert order == sorted(expected)
    assert set(order) == set(expected)
    assert set(space.valuations(space.deadlocks)) == {s for s, rows in expected.items() if not rows}
    total = sum(len(row.branches) for rows in expected.values() for row in rows)
    total += sum(not rows for rows in expected.values())
    assert made.transition_count == total
    check = _assert_choices if model.type is ModelType.MDP else _assert_chain
    for state, rows in expected.items():
        check(made, state, rows)
        for k, value in enumerate(interpreter.state_rewards(model, state)):
            assert abs(at(space, made.state_rewards[k], state) - float(value)) < 1e-12


def _assert_chain(made: Transitions, state: State, rows: tuple[interpreter.Row, ...]) -> None:
    branches = rows[0].branches if rows else ((1.0, state),)
    for probability, after in branches:
        assert abs(at(made.space, made.matrix, state, after) - probability) < 1e-12
    for k, rewards in enumerate(made.transition_rewards):
        expected = rows[0].rewards[k] if rows else 0.0
        assert abs(at(made.space, rewards[0], state) - expected) < 1e-12


def _assert_choices(made: Transitions, state: State, rows: tuple[interpreter.Row, ...]) -> None:
    space = made.space
    found: Counter[object] = Counter()
    for number, slot in enumerate(made.choices):
        actions = [
            a
            for (n, a), where in made.action_sets.items()
            if n == number and at(space, where, state)
        ]
        if not at(space, slot.guard, state):
            assert actions == []
            continue
        assert len(actions) == 1
        afters = {s for row in rows for _, s in row.branches} | {state}
        entries = {s: round(p, 12) for s in afters if (p := at(space, slot.matrix, state, s)) != 0}
        rewards = tuple(round(at(space, r[number], state), 12) for r in made.transition_rewards)
        found[actions[0], tuple(sorted(entries.items())), rewards] += 1
    expected: Counter[object] = Counter()
    for row in rows:
        entries = {s: round(float(p), 12) for p, s in row.branches}
        expected[
            row.action,
            tuple(sorted(entries.items())),
            tuple(round(float(r), 12) for r in row.rewards),
        ] += 1
    if not rows:
        expected[None, ((state, 1.0),), (0.0,) * len(made.transition_rewards)] += 1
    assert found == expected
