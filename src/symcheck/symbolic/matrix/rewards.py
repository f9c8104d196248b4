"""Reward structures as MTBDDs over row bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from math import fsum, inf
from typing import TYPE_CHECKING, TypeVar

from symcheck.semantics import interpreter
from symcheck.semantics.model import BoundRewards
from symcheck.symbolic.matrix.choice_coloring import JointClass
from symcheck.symbolic.matrix.products import nothing_lost
from symcheck.symbolic.model import EncodedCommand, LazySequence, StateSpace

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
        numbers: enabled joint commands per state, where a DTMC may have several.
    """
    return _lazily(space, lambda structure: _chain_reward(space, structure, numbers))


def _chain_reward(
    space: StateSpace, structure: BoundRewards, numbers: Mtbdd | None
) -> tuple[Mtbdd, ...]:
    actions = dict.fromkeys(e.event.action for e in space.symbolic.events)
    parts = []
    for action in actions:
        if _rewards_action(structure, action):
            weight = _action_weight(space, action)
            earned = _earned(space, structure, space.states, False, action)
            parts.append(nothing_lost(weight * earned, weight, earned))
    total = space.symbolic.manager.sum(parts)
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
    by_action: dict[str | None, list[Bdd]] = {}
    for joint in choice_class:
        if _rewards_action(structure, joint.event.event.action):
            by_action.setdefault(joint.event.event.action, []).append(joint.guard)
    return manager.sum(
        [_earned(space, structure, manager.disjunction(g), False, a) for a, g in by_action.items()]
    )


def _rewards_action(structure: BoundRewards, action: str | None) -> bool:
    return any(not item.on_states and item.action == action for item in structure.items)


def _earned(
    space: StateSpace, structure: BoundRewards, states: Bdd, on_states: bool, action: str | None
) -> Mtbdd:
    """Sum of the items on states, or on transitions of `action`, within `states`."""
    items = [
        i for i in structure.items if i.on_states == on_states and (on_states or i.action == action)
    ]
    parts = []
    translator = space.symbolic.translator
    for item in items:
        where = translator.boolean_on(item.guard, space.states) & states
        if faults := translator.faults(item.guard) & states:
            check_finite(space, space.symbolic.manager.zero, faults, on_states)
        if where:
            value = translator.number_on(item.value, where)
            check_finite(space, value, where & translator.undefined(item.value), on_states)
            parts.append(value)
    return space.symbolic.manager.sum(parts)


def check_finite(space: StateSpace, value: Mtbdd, undefined: Bdd, on_states: bool) -> None:
    """Raise the interpreter's ModelFault where a reward is infinite or has no value."""
    if not undefined and value.maximum_leaf < inf and value.minimum_leaf > -inf:
        return
    bad = undefined | value.equal(inf) | value.equal(-inf)
    for state in islice(space.valuations(bad), 1):
        if on_states:
            interpreter.state_rewards(space.symbolic.model, state)
        else:
            interpreter.choices(space.symbolic.model, state)


def _action_weight(space: StateSpace, action: str | None) -> Mtbdd:
    """Sum of the probabilities (rates) of all transitions of an action, before division by the
    number of choices.
    """
    parts = []
    for event in space.symbolic.events:
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
