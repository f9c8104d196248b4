"""Transition matrices on the reachable states: one MTBDD for a DTMC or CTMC, one per choice class
for an MDP.

The matrix of an event, over its touched variables, is the product over participants of the sums of
their commands. Events that touch the same variables are added first, then multiplied with the
identity of the other variables and restricted to reachable rows.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from symcheck.options import Options
from symcheck.symbolic.checks import check_model
from symcheck.symbolic.events.commands import frame, touched_by
from symcheck.symbolic.matrix.choice_coloring import choice_classes, race
from symcheck.symbolic.matrix.products import nothing_lost
from symcheck.symbolic.matrix.rewards import chain_rewards, class_rewards, state_rewards
from symcheck.symbolic.model import (
    ChoiceClass,
    EncodedCommand,
    EncodedEvent,
    StateSpace,
    SymbolicModel,
    Transitions,
)

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["choice_counts", "full_matrix", "participant_matrix", "transitions"]


def transitions(
    space: StateSpace, options: Options, observer: Callable[[object], None] | None = None
) -> Transitions:
    """The matrices, rewards and choices of a model, on its reachable states.

    Args:
        space: the reachable states.
        options: what is checked, and whether deadlocks get loops.
        observer: is called with the result.

    Raises:
        ModelFault: a reachable state breaks a rule: probabilities do not sum to 1 (unless
            `options.check_sums` is off), a probability is negative, a value is out of range, or
            there is a deadlock and `options.fix_deadlocks` is off.
        ResourceError: a limit of the manager is reached.
    """
    started = time.perf_counter()
    check_model(space, options)
    result = (
        _mdp_transitions(space)
        if space.symbolic.model.type.has_choices
        else _chain_transitions(space)
    )
    result = replace(result, seconds=time.perf_counter() - started)
    if observer is not None:
        observer(result)
    return result


# --------------------------------------------------------------------------------------- DTMC, CTMC


def _chain_transitions(space: StateSpace) -> Transitions:
    symbolic = space.symbolic
    parts = [(e, e.participants) for e in symbolic.events if not e.guard.disjoint(space.states)]
    matrix = full_matrix(symbolic, parts, space.states)
    numbers = choice_counts(space) if symbolic.model.type.chooses_uniformly else None
    if numbers is not None:
        matrix = nothing_lost(matrix / numbers, matrix)
    if space.deadlocks:
        matrix = matrix + _self_loops(symbolic, space.deadlocks)
    return Transitions(
        space, matrix, (), {}, state_rewards(space), chain_rewards(space, numbers), space.deadlocks
    )


def choice_counts(space: StateSpace) -> Mtbdd | None:
    """The number of enabled joint commands per state (1 where none is); None if no state enables
    several.
    """
    manager = space.symbolic.manager
    once = twice = manager.false
    for event in space.symbolic.events:
        event_once, event_twice = _multiplicity(space, event)
        twice = twice | event_twice | (once & event_once)
        once = once | event_once
    if not twice:
        return None
    counts = [
        product(_counted(space, commands) for commands in e.participants)
        for e in space.symbolic.events
    ]
    return manager.sum(counts).times_bdd(space.states).maximum(1.0)


def _multiplicity(space: StateSpace, event: EncodedEvent) -> tuple[Bdd, Bdd]:
    """The reachable states where a joint command of the event is enabled, and those where several
    are.
    """
    once, twice = space.states & event.guard, space.symbolic.manager.false
    for commands in event.participants if once else ():
        seen = space.symbolic.manager.false
        for command in commands:
            twice = twice | (once & seen & command.guard)
            seen = seen | command.guard
    return once, twice


def _counted(space: StateSpace, commands: Sequence[EncodedCommand]) -> Mtbdd:
    return space.symbolic.manager.sum([c.guard.to_mtbdd() for c in commands])


# ---------------------------------------------------------------------------------------------- MDP


def _mdp_transitions(space: StateSpace) -> Transitions:
    symbolic = space.symbolic
    manager = symbolic.manager
    classes = choice_classes(space)
    if symbolic.model.type.immediate_choices:
        classes = (race(space), *classes)
    actions: dict[tuple[int, str | None], Bdd] = {}
    choices: list[ChoiceClass] = []
    for number, joint in enumerate(classes):
        for j in joint:
            key = (number, j.event.event.action)
            actions[key] = actions.get(key, manager.false) | j.guard
        matrix = manager.sum(
            [full_matrix(symbolic, [(j.event, j.participants)], j.guard) for j in joint]
        )
        choices.append(ChoiceClass(matrix, manager.disjunction([j.guard for j in joint])))
    if space.deadlocks:
        classes = classes or ((),)
        first = choices[0] if choices else ChoiceClass(manager.zero, manager.false)
        choices[:1] = [
            ChoiceClass(
                first.matrix + _self_loops(symbolic, space.deadlocks), first.guard | space.deadlocks
            )
        ]
        actions[0, None] = actions.get((0, None), manager.false) | space.deadlocks
    return Transitions(
        space,
        None,
        tuple(choices),
        actions,
        state_rewards(space),
        class_rewards(space, classes),
        space.deadlocks,
    )


# ------------------------------------------------------------------------------------------- pieces


def full_matrix(
    symbolic: SymbolicModel,
    parts: Iterable[tuple[EncodedEvent, Sequence[Sequence[EncodedCommand]]]],
    rows: Bdd,
) -> Mtbdd:
    """The sum of events, over all row and column bits, on given rows.

    Args:
        symbolic: the encoded model.
        parts: events with the commands of each participant that are included.
        rows: the rows, a set over row bits.
    """
    groups: dict[tuple[int, ...], list[Mtbdd]] = {}
    for event, participants in parts:
        matrix = product(
            participant_matrix(symbolic, chosen, touched_by(commands), rows)
            for chosen, commands in zip(participants, event.participants, strict=True)
        )
        groups.setdefault(event.touched, []).append(matrix)
    everything = range(len(symbolic.encoding.variables))
    manager = symbolic.manager
    return manager.sum(
        [
            manager.sum(matrices)
            .times_bdd(rows)
            .times_bdd(frame(symbolic.translator, everything, touched))
            for touched, matrices in groups.items()
        ]
    )


def participant_matrix(
    symbolic: SymbolicModel, commands: Sequence[EncodedCommand], touched: Sequence[int], rows: Bdd
) -> Mtbdd:
    """Sum of commands, over row bits and the column bits of `touched`; right on `rows`, arbitrary
    elsewhere.
    """
    parts = []
    for command in commands:
        if command.guard.disjoint(rows):
            continue
        for u in command.updates:
            moves = command.guard & u.relation & frame(symbolic.translator, touched, u.assigned)
            parts.append(
                moves.to_mtbdd(u.probability)
                if isinstance(u.probability, float)
                else u.probability.times_bdd(moves)
            )
    return symbolic.manager.sum(parts)


def _self_loops(symbolic: SymbolicModel, states: Bdd) -> Mtbdd:
    return (
        states & frame(symbolic.translator, range(len(symbolic.encoding.variables)), ())
    ).to_mtbdd()


def product(factors: Iterable[Mtbdd]) -> Mtbdd:
    """The product of at least one factor, left to right; no edge is lost."""
    iterator = iter(factors)
    result = next(iterator)
    for factor in iterator:
        result = nothing_lost(result * factor, result, factor)
    return result
