"""Reward structures as MTBDDs over row bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from math import fsum, inf
from typing import TYPE_CHECKING, TypeVar

from symcheck.semantics import interpreter
from symcheck.semantics.model import BoundRewards
from symcheck.symbolic.events.commands import possible
from symcheck.symbolic.matrix.choice_coloring import JointClass
from symcheck.symbolic.matrix.products import nothing_lost
from symcheck.symbolic.model import EncodedCommand, EncodedEvent, LazySequence, StateSpace

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

T = TypeVar("T")

__all__ = ["chain_rewards", "class_rewards", "state_rewards"]


def state_rewards(space: StateSpace) -> LazySequence[Mtbdd]:
    """The state rewards of each structure, 0 outside the reachable states."""
    return _lazily(space, lambda structure: _earned(space, structure, space.states, True, None))


def _lazily(space: StateSpace, rewards: Callable[[BoundRewards], T]) -> LazySequence[T]:
    """The rewards of each structure, computed on first access."""
    return LazySequence([partial(rewards, r) for r in space.symbolic.model.rewards])


def chain_rewards(space: StateSpace, numbers: Mtbdd | None) -> LazySequence[tuple[Mtbdd, ...]]:
    """Transition rewards of a DTMC or CTMC: per structure one MTBDD, the sum over transitions of
    probability (rate) times reward.

    Args:
        space: the reachable states.
        numbers: enabled joint commands per state, where a DTMC may have several.
    """
    return _lazily(space, lambda s: _chain_reward(space, s, numbers, space.symbolic.events))


def _chain_reward(
    space: StateSpace,
    structure: BoundRewards,
    numbers: Mtbdd | None,
    events: Sequence[EncodedEvent],
) -> tuple[Mtbdd, ...]:
    parts = []
    for action in dict.fromkeys(e.event.action for e in events):
        if _rewards_action(structure, action):
            weight = _action_weight(space, events, action)
            earned = _earned(space, structure, weight.compare(">", 0.0), False, action)
            parts.append(nothing_lost(weight * earned, weight, earned))
    total = space.symbolic.manager.sum(parts)
    _raise_fault(space, _infinite(total), on_states=False)
    return (total if numbers is None else nothing_lost(total / numbers, total),)


def class_rewards(
    space: StateSpace, classes: Sequence[Sequence[JointClass]]
) -> LazySequence[tuple[Mtbdd, ...]]:
    """Transition rewards of an MDP: per structure and choice class, the reward of a state's choice
    in that class.
    """
    return _lazily(space, lambda s: tuple(_class_reward(space, s, c) for c in classes))


def _class_reward(
    space: StateSpace, structure: BoundRewards, choice_class: Sequence[JointClass]
) -> Mtbdd:
    manager = space.symbolic.manager
    if choice_class and choice_class[0].event.event.is_markovian:
        return _chain_reward(space, structure, None, [j.event for j in choice_class])[0]
    by_action: dict[str | None, list[Bdd]] = {}
    for joint in choice_class:
        if _rewards_action(structure, joint.event.event.action):
            happening = joint.guard & possible(space.symbolic.translator, joint.participants)
            by_action.setdefault(joint.event.event.action, []).append(happening)
    return manager.sum(
        [_earned(space, structure, manager.disjunction(g), False, a) for a, g in by_action.items()]
    )


def _rewards_action(structure: BoundRewards, action: str | None) -> bool:
    return any(not item.on_states and item.action == action for item in structure.items)


def _earned(
    space: StateSpace, structure: BoundRewards, states: Bdd, on_states: bool, action: str | None
) -> Mtbdd:
    """Sum of the items on states, or on transitions of `action`, within `states`.

    Raises the interpreter's ModelFault where a reward is infinite or has no value.
    """
    items = [
        i for i in structure.items if i.on_states == on_states and (on_states or i.action == action)
    ]
    parts, faulty = [], []
    translator, manager = space.symbolic.translator, space.symbolic.manager
    for item in items:
        where = translator.boolean_on(item.guard, states) & states
        faulty.append(translator.faults(item.guard) & states)
        if where:
            value = translator.number_on(item.value, where)
            without_value = translator.faults(item.value) | translator.undefined(item.value)
            faulty += [where & without_value, _infinite(value)]
            parts.append(value)
    total = manager.sum(parts)
    _raise_fault(space, manager.disjunction([*faulty, _infinite(total)]), on_states)
    return total


def _infinite(value: Mtbdd) -> Bdd:
    return value.equal(inf) | value.equal(-inf)


def _raise_fault(space: StateSpace, faulty: Bdd, on_states: bool) -> None:
    """Raise what the interpreter raises in the first state of a set, unless the set is empty."""
    for state in islice(space.valuations(faulty), 1):
        model = space.symbolic.model
        if on_states:
            interpreter.state_rewards(model, state)
        else:
            interpreter.choices(model, state, check_sums=False)
        raise AssertionError(
            f"a reward without a finite value in {state}, where the interpreter finds no fault"
        )


def _action_weight(space: StateSpace, events: Sequence[EncodedEvent], action: str | None) -> Mtbdd:
    """Sum of the probabilities (rates) of all transitions of an action, before division by the
    number of choices.
    """
    parts = []
    for event in events:
        enabled = event.guard & space.states
        if event.event.action == action and enabled:
            weight = enabled.to_mtbdd()
            for commands in event.participants:
                weight = weight * _commands_weight(space, commands)
            parts.append(weight)
    return space.symbolic.manager.sum(parts)


def _commands_weight(space: StateSpace, commands: Sequence[EncodedCommand]) -> Mtbdd:
    parts = []
    for command in commands:
        # fsum, so that 1/3 + 1/3 + 1/3 is 1
        parts.append(
            command.guard.to_mtbdd(
                fsum(u.probability for u in command.updates if isinstance(u.probability, float))
            )
        )
        parts.extend(
            u.probability.times_bdd(command.guard)
            for u in command.updates
            if not isinstance(u.probability, float)
        )
    return space.symbolic.manager.sum(parts)
