"""Commands and events as diagrams.

The relation of an event is the conjunction of its participants' relations, each the union of the
relations of its commands. So combinations of commands, of which there may be 2**n, are never
enumerated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from symcheck.semantics.model import BoundCommand, BoundUpdate, Event
from symcheck.symbolic.encoding.translate import Translator
from symcheck.symbolic.model import EncodedCommand, EncodedEvent, EncodedUpdate

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd

__all__ = [
    "encode_command",
    "encode_event",
    "evaluated_valuations",
    "frame",
    "positive",
    "possible",
    "touched_by",
    "with_maximal_progress",
]


def encode_event(translator: Translator, event: Event) -> EncodedEvent:
    """Encode the commands of an event, its guard and its transition relation."""
    participants = tuple(
        tuple(encode_command(translator, c) for c in commands) for commands in event.participants
    )
    manager = translator.manager
    guard = relation = manager.true
    for commands in participants:
        guard = guard & manager.disjunction([c.guard for c in commands])
    if guard:
        for commands in sorted(participants, key=lambda cs: -min(touched_by(cs), default=0)):
            relation = relation & _participant_relation(translator, commands)
    else:
        relation = manager.false
    touched = tuple(sorted({i for commands in participants for i in touched_by(commands)}))
    return EncodedEvent(
        event, participants, touched, guard, relation, evaluated_valuations(translator, event)
    )


def with_maximal_progress(
    translator: Translator, events: Sequence[EncodedEvent]
) -> list[EncodedEvent]:
    """The events of a Markov automaton, of which those that take time wait for all others."""
    manager = translator.manager
    at_once = [e for e in events if not e.event.is_markovian]
    if len(at_once) == len(events):
        return list(events)
    waits = ~manager.disjunction([e.guard & possible(translator, e.participants) for e in at_once])

    def waiting(event: EncodedEvent) -> EncodedEvent:
        return replace(
            event,
            participants=tuple(
                tuple(replace(c, guard=c.guard & waits) for c in commands)
                for commands in event.participants
            ),
            guard=event.guard & waits,
            relation=event.relation & waits,
        )

    return [waiting(e) if e.event.is_markovian else e for e in events]


def evaluated_valuations(translator: Translator, event: Event) -> int | None:
    """Number of valuations for which an event is encoded on the fly; None if encoded in full."""
    parts = [
        part
        for commands in event.participants
        for c in commands
        for kind in translator.on_the_fly_parts(c)
        for part in kind
    ]
    return sum(part.evaluated for part in parts) if parts else None


def encode_command(translator: Translator, command: BoundCommand) -> EncodedCommand:
    """Encode a guard and the updates behind it. An update whose probability is the constant 0 is
    left out.
    """
    guard = translator.boolean(command.guard)
    updates: list[EncodedUpdate] = []
    if guard:
        updates = [
            u
            for u in (_encode_update(translator, update) for update in command.updates)
            if u.probability != 0.0
        ]
    return EncodedCommand(command, guard, tuple(updates))


def _encode_update(translator: Translator, update: BoundUpdate) -> EncodedUpdate:
    true = translator.manager.true
    probability = translator.probability(update.probability)
    relation, in_range = true, true
    variables = translator.encoding.variables
    for index, expression in sorted(
        update.assignments, key=lambda a: -translator.encoding.rank[variables[a[0]].name]
    ):
        assigned = translator.assignment(variables[index], expression)
        relation, in_range = relation & assigned.relation, in_range & assigned.in_range
    return EncodedUpdate(
        update, probability, tuple(i for i, _ in update.assignments), relation, in_range
    )


def _participant_relation(translator: Translator, commands: Sequence[EncodedCommand]) -> Bdd:
    union = translator.manager.disjunction
    touched = touched_by(commands)
    parts = []
    for command in commands:
        moves = [
            u.relation & frame(translator, touched, u.assigned) & positive(translator, u)
            for u in command.updates
        ]
        parts.append(command.guard & union(moves))
    return union(parts)


def positive(translator: Translator, update: EncodedUpdate) -> Bdd:
    """The rows where an update has a positive probability (rate)."""
    if isinstance(update.probability, float):
        return translator.manager.true if update.probability > 0 else translator.manager.false
    return update.probability.compare(">", 0.0)


def possible(translator: Translator, participants: Sequence[Sequence[EncodedCommand]]) -> Bdd:
    """The rows where each participant has an update of positive probability (rate); elsewhere none
    is carried out.
    """
    manager = translator.manager
    moves = [
        [c.guard & positive(translator, u) for c in commands for u in c.updates]
        for commands in participants
    ]
    return manager.conjunction([manager.disjunction(m) for m in moves])


def touched_by(commands: Sequence[EncodedCommand]) -> tuple[int, ...]:
    """Indices of the variables that the commands assign."""
    return tuple(sorted({i for c in commands for u in c.updates for i in u.assigned}))


def frame(translator: Translator, touched: Sequence[int], assigned: Sequence[int]) -> Bdd:
    """The relation that keeps the touched variables that are not assigned."""
    return translator.identity(tuple(i for i in touched if i not in assigned))
