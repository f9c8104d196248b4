"""Concurrent games: what players can pick, and the events of their joint actions.

In a state, each player picks one of the actions that commands of the player's modules enable, or
nothing if there is none. A command takes part if all of its actions are picked. Modules that belong
to no player follow the joint action, and stay as they are where none of their commands takes part.
What does not follow from a text alone is checked where states are known: each joint action has to
be one choice.

Source: Kwiatkowska, Norman, Parker & Santos (2021), Automatic verification of concurrent stochastic
systems, section 5.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import product

from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.model import (
    BoundCommand,
    BoundModule,
    BoundPlayer,
    BoundReward,
    BoundRewards,
    BoundUpdate,
    Event,
)
from symcheck.semantics.players import joined
from symcheck.syntax.ast import PRIME, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import names, substitute

__all__ = ["Picks", "joint_events", "joint_rewards", "picks"]

_MOST_JOINT_ACTIONS = 10_000
"""Each is an event, which is compiled: more take minutes."""

_ONE = Literal(Fraction(1), Type.DOUBLE)
_NOTHING = (BoundUpdate(_ONE, ()),)

_Part = tuple[BoundCommand, ...]

Picks = Mapping[str, Expression]
"""Per action of a player, the states in which it can be picked."""


def picks(modules: Sequence[BoundModule], player: BoundPlayer) -> Picks:
    """The actions of a player, in the order of the text."""
    guards: dict[str, list[Expression]] = {}
    for command in _owned(modules, player):
        if command.action is not None:
            guards.setdefault(command.action, []).append(command.guard)
    return {action: _any(of) for action, of in guards.items()}


def joint_events(
    modules: Sequence[BoundModule],
    players: Sequence[BoundPlayer],
    variables: Sequence[str],
    report: DiagnosticCollector,
) -> tuple[Event, ...]:
    """An event for each joint action; faults are reported.

    Args:
        modules: the modules, bound.
        players: the players.
        variables: the names of all variables.
        report: collects faults of commands.

    Raises:
        UnsupportedError: there are too many joint actions.
    """
    available = [picks(modules, p) for p in players]
    _check_commands(modules, players, report)
    count = math.prod(len(a) + 1 for a in available)
    if count > _MOST_JOINT_ACTIONS:
        raise UnsupportedError(
            f"the players have {count:,} joint actions, and more than {_MOST_JOINT_ACTIONS:,} are "
            "not supported"
        )
    game = _Game(modules, players, available, variables)
    found: list[Event] = []
    for joint in product(*((*a, None) for a in available)):
        try:
            found += game.event(joint)
        except InputError as fault:
            report.absorb(fault)
    return tuple(found)


def joint_rewards(
    rewards: BoundRewards,
    modules: Sequence[BoundModule],
    players: Sequence[BoundPlayer],
    events: Sequence[Event],
    report: DiagnosticCollector,
) -> BoundRewards:
    """A reward structure with an item for each joint action that has the actions of an item.

    Args:
        rewards: the structure.
        modules: the modules, bound.
        players: the players.
        events: the joint actions.
        report: collects faults of items.
    """
    owner, items = _owners(modules, players), list[BoundReward]()
    for item in rewards.items:
        if item.on_states:
            items.append(item)
            continue
        _check_picked(owner, item, report)
        wanted = {a for a in (item.action, *item.others) if a is not None}
        items += (
            replace(item, action=e.action, others=()) for e in events if wanted <= set(e.picks)
        )
    return replace(rewards, items=tuple(items))


def _owners(modules: Sequence[BoundModule], players: Sequence[BoundPlayer]) -> Mapping[str, str]:
    """The name of the player of each action."""
    owner: dict[str, str] = {}
    for player in players:
        for action in picks(modules, player):
            owner.setdefault(action, player.name)
    return owner


def _check_commands(
    modules: Sequence[BoundModule], players: Sequence[BoundPlayer], report: DiagnosticCollector
) -> None:
    """Report actions of several players or of none, and commands of a player without its action."""
    owner = _owners(modules, players)
    for player in players:
        for command in _owned(modules, player):
            if command.action is None:
                message = f"a command of player {player.name} has no action"
                hint = "write an action in the brackets; modules that nobody owns may have none"
                report.input("players", message, command.span, hint)
            elif owner[command.action] != player.name:
                message = f"action {command.action} belongs to player {owner[command.action]}"
                hint = f"the first action of a command is one of its player, {player.name}"
                report.input("players", message, command.span, hint)
    for command in (c for m in modules for c in m.commands):
        _check_picked(owner, command, report)


def _check_picked(
    owner: Mapping[str, str], item: BoundCommand | BoundReward, report: DiagnosticCollector
) -> None:
    """Report actions of a list that nobody can pick, or not at once."""
    seen: dict[str, str] = {}
    for name in (a for a in (item.action, *item.others) if a is not None):
        player = owner.get(name)
        if player is None:
            message = f"action {name} belongs to no player"
            hint = "it is the first action of a command in a module of its player"
            report.input("players", message, item.span, hint)
        elif player in seen:
            message = f"player {player} cannot pick {seen[player]} and {name} at once"
            report.input("players", message, item.span)
        else:
            seen[player] = name


@dataclass(frozen=True, slots=True)
class _Game:
    modules: Sequence[BoundModule]
    players: Sequence[BoundPlayer]
    available: Sequence[Picks]
    variables: Sequence[str]

    def event(self, joint: tuple[str | None, ...]) -> Iterator[Event]:
        """The event of a joint action; none if nothing can happen by it.

        Raises InputError if values after the step depend on each other.
        """
        picked = {a for a in joint if a is not None}
        parts: list[_Part] = []
        conditions: list[Expression] = []
        for player, pick, actions in zip(self.players, joint, self.available, strict=True):
            if pick is None:
                conditions.append(_not(_any(actions.values())))
                continue
            own = self._taking_part(picked, player.modules)
            if not own:
                return
            parts += own if len(own) == 1 else [_or_stays(p) for p in own]
            if len(own) > 1:
                conditions.append(_any(c.guard for p in own for c in p))
        everybody = frozenset[str]().union(*(p.modules for p in self.players))
        others = self._taking_part(picked, {m.name for m in self.modules} - everybody)
        parts += map(_or_stays, others)
        if not picked:  # somebody acts, or it is a deadlock
            conditions.append(_any(c.guard for p in others for c in p))
        condition = simplify(joined(Operator.AND, conditions, True))
        if condition == Literal(False, Type.BOOL):
            return
        parts[0] = tuple(
            replace(c, guard=simplify(joined(Operator.AND, (c.guard, condition), True)))
            for c in parts[0]
        )
        together = tuple(map(self._together, self._linked(parts)))
        yield Event(",".join(a for a in joint if a) or None, together, joint)

    def _taking_part(self, picked: set[str], modules: Iterable[str]) -> list[_Part]:
        """The commands of each of some modules all of whose actions are picked."""
        parts = (
            tuple(c for c in m.commands if c.actions <= picked)
            for m in self.modules
            if m.name in modules
        )
        return [p for p in parts if p]

    def _linked(self, parts: Iterable[_Part]) -> list[list[_Part]]:
        """The parts, those together of which one reads what another one assigns."""
        groups: list[list[_Part]] = []
        for part in parts:
            own, rest = [part], []
            for group in groups:
                if any(self._follows(p, part) or self._follows(part, p) for p in group):
                    own = [*group, *own]
                else:
                    rest.append(group)
            groups = [*rest, own]
        return groups

    def _follows(self, part: _Part, other: _Part) -> bool:
        """Whether one part reads a value after the step that the other one assigns."""
        read = {n.removesuffix(PRIME) for c in part for n in _next(c)}
        assigned = (i for c in other for u in c.updates for i, _ in u.assignments)
        return bool(read) and not read.isdisjoint(self.variables[i] for i in assigned)

    def _together(self, parts: list[_Part]) -> _Part:
        """Parts as one, whose updates read values before the step only."""
        if not any(_next(c) for part in parts for c in part):
            (part,) = parts
            return part
        return tuple(self._merged(commands) for commands in product(*parts))

    def _merged(self, commands: _Part) -> BoundCommand:
        guard = simplify(joined(Operator.AND, (c.guard for c in commands), True))
        updates = tuple(map(self._update, product(*(c.updates for c in commands))))
        place = next(filter(_next, commands), commands[0])
        return BoundCommand(place.module, None, guard, updates, span=place.span)

    def _update(self, updates: tuple[BoundUpdate, ...]) -> BoundUpdate:
        factors = [u.probability for u in updates if u.probability != _ONE]
        probability = joined(Operator.TIMES, factors, True) if factors else _ONE
        given = {self.variables[i]: (i, e) for u in updates for i, e in u.assignments}
        known: dict[str, Expression] = {}

        def after(variable: str, above: tuple[str, ...]) -> Expression:
            if variable not in given:
                return Name(variable)
            if variable in above:
                circle = " -> ".join(f"{v}{PRIME}" for v in (*above, variable))
                message = f"values after the step depend on each other: {circle}"
                raise InputError(Diagnostic(message, given[variable][1].span, "cycle"))
            if variable not in known:
                read = given[variable][1]
                known[variable] = substitute(
                    read,
                    {n: after(n.removesuffix(PRIME), (*above, variable)) for n in _primed(read)},
                )
            return known[variable]

        assignments = tuple((i, after(v, ())) for v, (i, _) in given.items())
        place = next((u for u in updates if u.assignments), updates[0])
        return BoundUpdate(probability, assignments, span=place.span)


def _owned(modules: Iterable[BoundModule], player: BoundPlayer) -> Iterator[BoundCommand]:
    return (c for m in modules if m.name in player.modules for c in m.commands)


def _primed(expression: Expression) -> list[str]:
    """The values after the step that an expression reads."""
    return sorted(n for n in names(expression) if n.endswith(PRIME))


def _next(command: BoundCommand) -> list[str]:
    """The values after the step that a command reads."""
    return [n for u in command.updates for _, e in u.assignments for n in _primed(e)]


def _or_stays(commands: _Part) -> _Part:
    """Commands of a module, and what happens if none of them is enabled: nothing."""
    otherwise = _not(_any(c.guard for c in commands))
    if otherwise == Literal(False, Type.BOOL):
        return commands
    return (*commands, BoundCommand(commands[0].module, None, otherwise, _NOTHING))


def _any(conditions: Iterable[Expression]) -> Expression:
    return simplify(joined(Operator.OR, conditions, False))


def _not(condition: Expression) -> Expression:
    return simplify(Unary(UnaryOperator.NOT, condition))
