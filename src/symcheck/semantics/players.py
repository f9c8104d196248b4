"""The players of a game: who a coalition is, and whose states are whose.

A state belongs to the player who owns what can be done there: an unlabelled command belongs to the
player of its module, an event of an action to the player of the action. So it is decided by the
guards of commands, on every engine. As in PRISM-games, all choices of a state have one owner.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce

from symcheck.errors import Diagnostic, InputError, NameFault
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundModel, Event
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import Binary, Coalition, Expression, Literal, Type
from symcheck.syntax.operators import Operator

__all__ = ["joined", "members", "owned_states", "two_owners"]


def members(coalition: Coalition, model: BoundModel) -> frozenset[int]:
    """The players of a coalition, numbered from 0.

    Raises NameFault for an unknown one.
    """
    if coalition.players is None:
        return frozenset(range(len(model.players)))
    names = {p.name: i for i, p in enumerate(model.players)}
    numbers = {str(i + 1): i for i in range(len(names))} | names
    for name in coalition.players:
        if name not in numbers:
            known = ", ".join(names)
            raise NameFault(
                Diagnostic(
                    f"there is no player {name}",
                    coalition.span,
                    "unknown-player",
                    f"players are {known}, or 1 to {len(names)}",
                )
            )
    return frozenset(numbers[name] for name in coalition.players)


def owned_states(model: BoundModel) -> Sequence[Expression]:
    """Per player, the states in which something can be done that is the player's.

    Raises InputError: something that can be done belongs to nobody.
    """
    events: list[list[Event]] = [[] for _ in model.players]
    for event in _owned_events(model):
        events[_owner(event, model)].append(event)
    return [joined(Operator.OR, map(_enabled, of), False) for of in events]


def two_owners(model: BoundModel, state: Sequence[bool | int]) -> InputError:
    """The error that in a state several players can do something."""
    values = dict(zip((v.name for v in model.variables), state, strict=True))
    active = [e for e in _owned_events(model) if evaluate(_enabled(e), values)]
    names = {model.players[_owner(e, model)].name: e for e in active}
    last = list(names.values())[-1].participants[0][0]
    return InputError(
        Diagnostic(
            f"players {' and '.join(names)} can both choose in state "
            f"{describe_state(model.variables, state)}",
            last.span,
            "players",
            "in a turn-based game, each state belongs to one player",
        )
    )


def _owned_events(model: BoundModel) -> list[Event]:
    """All events but the passing of time, which is a choice of the owner of a state."""
    time = None if model.clocks is None else model.clocks.time
    return [e for e in model.events if e.action is None or e.action != time]


def _owner(event: Event, model: BoundModel) -> int:
    """The number of the player of an event."""
    commands = [c for part in event.participants for c in part]
    modules = {model.modules[c.module].name for c in commands}
    for i, player in enumerate(model.players):
        if event.action in player.actions or (event.action is None and modules <= player.modules):
            return i
    what = f"action {event.action}" if event.action else f"module {', '.join(sorted(modules))}"
    raise InputError(
        Diagnostic(
            f"{what} belongs to no player",
            commands[0].span,
            "players",
            "write it between player and endplayer, an action in brackets",
        )
    )


def _enabled(event: Event) -> Expression:
    parts = (joined(Operator.OR, (c.guard for c in p), False) for p in event.participants)
    return joined(Operator.AND, parts, True)


def joined(operator: Operator, parts: Iterable[Expression], none: bool) -> Expression:
    """The parts, joined by an operator, as a balanced tree; for no parts a truth value."""
    level = list(parts)
    while len(level) > 1:
        level = [
            reduce(lambda a, b: Binary(operator, a, b), level[i : i + 2])
            for i in range(0, len(level), 2)
        ]
    return level[0] if level else Literal(none, Type.BOOL)
