"""The cone of influence: the variables on which what properties read may depend.

A variable is in the cone if the properties or their rewards read it, or if it decides how some
event changes a variable of the cone, with which probability or rate, or whether the event is
possible. A timer is outside the cone if it never blocks the action `time`, and if no guard of
another module, property or reward reads it. States that agree on the variables of the cone are
strongly bisimilar for what the properties read, apart from choices that occur twice; so the
variables outside may keep their initial values. Faults of the assignments to them are not found on
the restricted model: whoever uses it explores the whole model too.

Source: E. Clarke, O. Grumberg, D. Peled: Model Checking (1999), 13.1. Variables have next-state
functions there. Here, a module may block an action: unless it is shown that it never does, the
variables of its guards are in the cone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import isfinite

import numpy as np

from symcheck.semantics.expressions.vectorised import evaluate_columns, open_mesh
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundUpdate,
    Event,
    Observations,
    Variable,
)
from symcheck.semantics.reduction import tuning
from symcheck.syntax.ast import Expression, Literal, Type
from symcheck.syntax.traversal import names

__all__ = ["outside_cone", "restricted_to_cone"]

Participant = Sequence[BoundCommand]
_TRUE, _ONE = Literal(True, Type.BOOL), Literal(Fraction(1), Type.DOUBLE)
_INITIAL_STATES = '"init"'
"""The label "init" in observed expressions: all variables tell the initial states apart."""


def outside_cone(model: BoundModel, observed: Observations) -> frozenset[int]:
    """The variables (indices) on which nothing that is observed depends.

    None of a model with `init … endinit`, or of one whose events have too many participants.
    """
    participants = [p for e in model.events for p in e.participants]
    read = {name for e in observed.expressions for name in names(e)}
    if (
        model.initial is not None
        or _INITIAL_STATES in read
        or len(participants) > tuning.MAX_CONE_PARTICIPANTS
    ):
        return frozenset()
    if observed.rewards:
        items = (item for structure in model.rewards for item in structure.items)
        read.update(name for item in items for e in (item.guard, item.value) for name in names(e))
    cone = {i for i, v in enumerate(model.variables) if v.name in read}
    never_blocks = {id(p): _never_blocks(p, model) for p in participants}
    while True:
        active = (p for p in participants if not never_blocks[id(p)] or _changes(p, cone))
        larger = cone.union(*(_read(p, cone, model) for p in active))
        if larger == cone:
            return frozenset(range(len(model.variables))) - cone
        cone = larger


def restricted_to_cone(model: BoundModel, outside: frozenset[int]) -> BoundModel:
    """The model in which the variables outside the cone of influence keep their initial values.

    Args:
        model: the bound model.
        outside: the result of `outside_cone` for it.
    """
    cone = set(range(len(model.variables))) - outside
    return replace(
        model,
        events=tuple(_restricted(event, cone, model) for event in model.events),
        derivation=partial(_derived, model, outside),
    )


def _derived(model: BoundModel, outside: frozenset[int], other: BoundModel) -> BoundModel:
    """The same model bound in rational arithmetic, transformed in the same way as `model`."""
    whole = other if model.derivation is None else model.derivation(other)
    return restricted_to_cone(whole, outside)


def _restricted(event: Event, cone: set[int], model: BoundModel) -> Event:
    active = [p for p in event.participants if _changes(p, cone) or not _never_blocks(p, model)]
    if not active:  # a step that changes nothing: it may earn a reward, or be counted
        first = event.participants[0][0]
        active = [(replace(first, guard=_TRUE, updates=(BoundUpdate(_ONE, ()),)),)]
    return replace(event, participants=tuple(_without_others(p, cone) for p in active))


def _without_others(participant: Participant, cone: set[int]) -> tuple[BoundCommand, ...]:
    """The commands of a participant without their assignments to variables outside the cone."""

    def kept(update: BoundUpdate) -> BoundUpdate:
        return replace(update, assignments=tuple(a for a in update.assignments if a[0] in cone))

    return tuple(replace(c, updates=tuple(map(kept, c.updates))) for c in participant)


def _changes(participant: Participant, cone: set[int]) -> bool:
    return any(i in cone for c in participant for u in c.updates for i, _ in u.assignments)


def _read(participant: Participant, cone: set[int], model: BoundModel) -> set[int]:
    """The variables that decide how a participant changes the cone, and whether it can."""
    expressions = [c.guard for c in participant]
    for update in (u for c in participant for u in c.updates):
        expressions.append(update.probability)
        expressions += [value for i, value in update.assignments if i in cone]
    read = {name for e in expressions for name in names(e)}
    return {i for i, v in enumerate(model.variables) if v.name in read}


def _never_blocks(participant: Participant, model: BoundModel) -> bool:
    """Whether a participant never changes whether, and with which weight, its events are possible.

    At least one of its commands is enabled in each valuation, and its probabilities (rates) are
    numbers with the sum 1. In a chain exactly one is: a second one would change the weight.
    """
    return all(map(_has_weight_one, participant)) and _are_enabled(
        [c.guard for c in participant], model.variables, once=not model.type.has_choices
    )


def _has_weight_one(command: BoundCommand) -> bool:
    weights = [u.probability.value for u in command.updates if isinstance(u.probability, Literal)]
    return (
        len(weights) == len(command.updates)
        and all(map(isfinite, weights))
        and sum(map(Fraction, weights)) == 1
    )


def _are_enabled(
    guards: Sequence[Expression], variables: Sequence[Variable], *, once: bool
) -> bool:
    """Whether some guard is true for each valuation, and if `once` exactly one.

    False also if there are too many valuations to decide it.
    """
    read = set().union(*map(names, guards))
    domains = {v.name: v.domain for v in variables if v.name in read}
    mesh = open_mesh(domains, tuning.MAX_CONE_VALUATIONS)
    if mesh is None:
        return False
    columns, shape = mesh
    lanes = [evaluate_columns(guard, columns).spread(shape) for guard in guards]
    if any(lane.faults is not None for lane in lanes):
        return False
    enabled = np.sum([lane.values for lane in lanes], axis=0)
    return bool(((enabled == 1) if once else (enabled >= 1)).all())
