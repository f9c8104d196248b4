"""Choice classes of an MDP, by greedy colouring of the conflict graph of its commands.

Two commands conflict if a reachable state enables both. Commands are coloured first within each
participant of an event, then joint commands across all events. A state has at most one choice in a
class. So each class has one matrix over row and column bits, without extra bits for nondeterminism,
and there are about as many classes as the most choices of a state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from symcheck.symbolic.model import EncodedCommand, EncodedEvent, StateSpace

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd

__all__ = ["JointClass", "choice_classes", "color_greedily", "race"]


@dataclass(frozen=True, eq=False)
class JointClass:
    """Joint commands of an event of which each state enables at most one.

    Attributes:
        participants: per participant, commands with disjoint guards.
        guard: the reachable states where a joint command is enabled.
    """

    event: EncodedEvent
    participants: tuple[tuple[EncodedCommand, ...], ...]
    guard: Bdd


def choice_classes(space: StateSpace) -> tuple[tuple[JointClass, ...], ...]:
    """The choice classes of an MDP, each a tuple of joint classes with disjoint guards."""
    joint = [
        j
        for event in space.symbolic.events
        if not event.event.is_markovian
        for j in _joint_classes(space, event)
    ]
    order = sorted(range(len(joint)), key=lambda i: (joint[i].event.event.action is None, i))
    groups = color_greedily([joint[i].guard for i in order])
    return tuple(tuple(joint[order[i]] for i in group) for group in groups)


def race(space: StateSpace) -> tuple[JointClass, ...]:
    """What takes time in a Markov automaton: one class, in which a state may have several commands,
    whose rates add up.
    """
    return tuple(
        JointClass(e, e.participants, space.states & e.guard)
        for e in space.symbolic.events
        if e.event.is_markovian and not e.guard.disjoint(space.states)
    )


def _joint_classes(space: StateSpace, event: EncodedEvent) -> list[JointClass]:
    """The combinations of the participants' classes that a reachable state enables."""
    union = space.symbolic.manager.disjunction
    start = space.states & event.guard
    partial: list[tuple[tuple[tuple[EncodedCommand, ...], ...], Bdd]] = (
        [((), start)] if start else []
    )
    for commands in event.participants:
        usable = [c for c in commands if not c.guard.disjoint(start)]
        classes = [
            tuple(usable[i] for i in group)
            for group in color_greedily([c.guard & start for c in usable])
        ]
        guards = [union([c.guard for c in group]) for group in classes]
        partial = [
            ((*chosen, group), guard & enabled)
            for chosen, guard in partial
            for group, enabled in zip(classes, guards, strict=True)
            if not guard.disjoint(enabled)
        ]
    return [JointClass(event, chosen, guard) for chosen, guard in partial]


def color_greedily(guards: Sequence[Bdd]) -> list[list[int]]:
    """Greedy colouring: each guard goes into the first class whose guards are disjoint from it.

    Returns the indices of the guards in each class.
    """
    classes: list[list[int]] = []
    unions: list[Bdd] = []
    for number, guard in enumerate(guards):
        for k, union in enumerate(unions):
            if union.disjoint(guard):
                classes[k].append(number)
                unions[k] = union | guard
                break
        else:
            classes.append([number])
            unions.append(guard)
    return classes
