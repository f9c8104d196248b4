"""Choices of an MDP without nondeterminism bits: commands that are never enabled together share a slot.

First within each participant of an event, then joint commands across all events, greedily. A state has at most one
choice in a slot, so that the number of slots is about the largest number of choices that any state has, and each slot
has one matrix over row and column bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from symcheck.symbolic.model import EncodedCommand, EncodedEvent, StateSpace

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd

__all__ = ["JointSlot", "choice_slots", "colour"]


@dataclass(frozen=True, eq=False)
class JointSlot:
    """Commands of an event, per participant pairwise disjoint, and the reachable states where one joint is enabled."""

    event: EncodedEvent
    participants: tuple[tuple[EncodedCommand, ...], ...]
    guard: Bdd


def choice_slots(space: StateSpace) -> tuple[tuple[JointSlot, ...], ...]:
    """The slots of an MDP, each a set of joint slots with disjoint guards."""
    joint = [j for event in space.symbolic.events for j in _joint_slots(space, event)]
    order = sorted(range(len(joint)), key=lambda i: (joint[i].event.event.action is None, i))
    groups = colour([joint[i].guard for i in order])
    return tuple(tuple(joint[order[i]] for i in group) for group in groups)


def _joint_slots(space: StateSpace, event: EncodedEvent) -> list[JointSlot]:
    """Combinations of the participants' slots that some reachable state enables."""
    union = space.symbolic.manager.disjunction
    start = space.states & event.guard
    partial: list[tuple[tuple[tuple[EncodedCommand, ...], ...], Bdd]] = (
        [((), start)] if start else []
    )
    for commands in event.participants:
        usable = [c for c in commands if not c.guard.disjoint(start)]
        classes = [
            tuple(usable[i] for i in group) for group in colour([c.guard & start for c in usable])
        ]
        guards = [union([c.guard for c in group]) for group in classes]
        partial = [
            ((*chosen, group), guard & enabled)
            for chosen, guard in partial
            for group, enabled in zip(classes, guards, strict=True)
            if not guard.disjoint(enabled)
        ]
    return [JointSlot(event, chosen, guard) for chosen, guard in partial]


def colour(guards: Sequence[Bdd]) -> list[list[int]]:
    """Partition into classes of pairwise disjoint guards: each goes into the first class that it does not meet."""
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
