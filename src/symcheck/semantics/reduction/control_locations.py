"""Control locations: the values of the control variables, and the moves between them.

Control variables act as program counters: guards compare them with constants, and updates set them
to constants.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import field
from itertools import product
from math import prod
from typing import cast

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import names, nodes, substitute

__all__ = ["Effect", "Location", "Locations", "Move", "control_variables", "is_false", "simplified"]

Location = tuple[bool | int, ...]
"""Values of the control variables, in the order of `Locations.control`."""

Values = tuple[bool | int, ...]
Control = tuple[tuple[int, Values], ...]
"""The effect of an update on the location: (position, possible new values) in order of position;
the other positions keep their values.
"""

_MAX_LOCATIONS = 1_000
"""Choose control variables with at most this many valuations."""

_MAX_WORK = 50_000
"""Choose control variables with at most this many pairs of a valuation and a command."""

_MAX_COMBINATIONS = 200
"""An event with more combinations of effects is assumed to lead to every location."""


def control_variables(model: BoundModel) -> tuple[int, ...]:
    """The control variables: guards compare them with constants, and updates set them to constants.

    Variables that more commands test are preferred, as long as the number of locations is small.

    Returns:
        Indices of variables, in increasing order.
    """
    commands = _commands(model)
    tested = Counter(i for c in commands for i in _tested(c.guard, model))
    # A variable with computed values is data, not control.
    data = {
        i
        for c in commands
        for u in c.updates
        for i, e in u.assignments
        if not _constant_like(e, model.variables[i].name)
    }
    chosen: list[int] = []
    size = 1
    for i, count in tested.most_common():
        domain = model.variables[i].domain
        if count < 2 or i in data or domain is None:
            continue
        grown = size * len(domain)
        if grown <= _MAX_LOCATIONS and grown * len(commands) <= _MAX_WORK:
            chosen.append(i)
            size = grown
    return tuple(sorted(chosen))


def _commands(model: BoundModel) -> list[BoundCommand]:
    return list({id(c): c for e in model.events for p in e.participants for c in p}.values())


def _tested(guard: Expression, model: BoundModel) -> set[int]:
    """Variables that a conjunct of the guard compares with a constant, or that are a conjunct."""
    tested: set[str] = set()
    stack = [guard]
    while stack:
        match stack.pop():
            case Binary(Operator.AND, left, right):
                stack += [left, right]
            case (
                Name(name)
                | Unary(UnaryOperator.NOT, Name(name))
                | Binary(Operator.EQ, Name(name), Literal())
                | Binary(Operator.EQ, Literal(), Name(name))
            ):
                tested.add(name)
            case _:
                pass
    return {i for i, v in enumerate(model.variables) if v.name in tested}


def _constant_like(expression: Expression, variable: str) -> bool:
    """Whether an expression is small and reads at most its own variable: `3`, `pc+1`, `!flag`."""
    return names(expression) <= {variable} and sum(1 for _ in nodes(expression)) <= 9


@dataclass(frozen=True, slots=True)
class Effect:
    """An update of a command at a location, and its effect on the location."""

    command: BoundCommand
    update: BoundUpdate
    control: Control

    @property
    def writes(self) -> frozenset[int]:
        """The variables that the update assigns."""
        return frozenset(i for i, _ in self.update.assignments)


@dataclass(frozen=True)
class Move:
    """An event that may be enabled at a location.

    Attributes:
        event: number of the event.
        effects: the possible effects of each participant.
        combinations: for each combination of effects on the location, the variables that are
            certainly written and the possible next locations.
        targets: for each participant, the possible next locations by the `control` of its effect.
    """

    event: int
    effects: tuple[tuple[Effect, ...], ...]
    combinations: tuple[tuple[frozenset[int], tuple[Location, ...]], ...]
    targets: tuple[dict[Control, frozenset[Location]], ...] = field(repr=False)


class Locations:
    """The control locations that may be reached, and the possible moves at each.

    Args:
        control: indices of the control variables (see `control_variables`).

    Attributes:
        names: names of the control variables.
        moves: the possible moves, by location.
    """

    def __init__(self, model: BoundModel, control: tuple[int, ...]) -> None:
        self.model = model
        self.control = control
        self.names = tuple(model.variables[i].name for i in control)
        self.domains = tuple(model.variables[i].domain or () for i in control)
        self._types = {v.name: v.type for v in model.variables}
        self._residuals: dict[tuple[int, tuple[bool | int, ...]], Expression] = {}
        self._positions: dict[int, tuple[Expression, tuple[int, ...]]] = {}
        self.moves: dict[Location, tuple[Move, ...]] = {}
        self._search()

    def residual(self, expression: Expression, location: Location) -> Expression:
        """An expression, simplified under the values of the control variables at a location."""
        if id(expression) not in self._positions:
            used = names(expression)
            # The cache holds the expression, so that its id is not used again.
            self._positions[id(expression)] = (
                expression,
                tuple(p for p, n in enumerate(self.names) if n in used),
            )
        positions = self._positions[id(expression)][1]
        if not positions:
            return expression
        key = id(expression), tuple(location[p] for p in positions)
        if key not in self._residuals:
            variables = self.model.variables
            values = {
                self.names[p]: variables[self.control[p]].literal(location[p]) for p in positions
            }
            self._residuals[key] = simplified(substitute(expression, values), self._types)
        return self._residuals[key]

    def steps(self) -> Iterator[tuple[Location, Move, int, Effect]]:
        """Each effect of each participant of each move, with its location."""
        for location, moves in self.moves.items():
            for move in moves:
                for participant, effects in enumerate(move.effects):
                    yield from ((location, move, participant, e) for e in effects)

    def _search(self) -> None:
        stack = list(self._initial())
        while stack:
            location = stack.pop()
            if location in self.moves:
                continue
            self.moves[location] = tuple(self._moves(location))
            stack += [
                t
                for m in self.moves[location]
                for _, targets in m.combinations
                for t in targets
                if t not in self.moves
            ]

    def _initial(self) -> Iterator[Location]:
        if self.model.initial is not None:
            yield from product(*self.domains)
        else:
            variables = (self.model.variables[i] for i in self.control)
            yield tuple(cast("bool | int", v.initial) for v in variables)

    def _moves(self, location: Location) -> Iterator[Move]:
        for number, event in enumerate(self.model.events):
            effects = tuple(tuple(self._effects(p, location)) for p in event.participants)
            if all(effects):
                yield self._move(number, effects, location)

    def _effects(self, commands: tuple[BoundCommand, ...], location: Location) -> Iterator[Effect]:
        for command in commands:
            if not is_false(self.residual(command.guard, location)):
                for update in command.updates:
                    yield Effect(command, update, self._control(update, location))

    def _control(self, update: BoundUpdate, location: Location) -> Control:
        changes: dict[int, Values] = {}
        for variable, expression in update.assignments:
            if variable in self.control:
                position = self.control.index(variable)
                values = tuple(self.domains[position])
                match self.residual(expression, location):
                    case Literal(bool() | int() as value) if value in values:
                        values = (value,)
                changes[position] = values
        return tuple(sorted(changes.items()))

    def _move(
        self, number: int, effects: tuple[tuple[Effect, ...], ...], location: Location
    ) -> Move:
        groups: list[dict[Control, frozenset[int]]] = []
        for participant in effects:
            group: dict[Control, frozenset[int]] = {}
            for e in participant:
                group[e.control] = group[e.control] & e.writes if e.control in group else e.writes
            groups.append(group)
        if prod(map(len, groups)) > _MAX_COMBINATIONS:
            everywhere = tuple(product(*self.domains))
            reached = tuple(dict.fromkeys(g, frozenset(everywhere)) for g in groups)
            return Move(number, effects, ((frozenset(), everywhere),), reached)
        combinations = []
        targets: list[dict[Control, set[Location]]] = [{c: set() for c in g} for g in groups]
        for chosen in product(*groups):
            new: list[Values] = [(x,) for x in location]
            for control in chosen:
                for position, values in control:
                    new[position] = values
            to = tuple(product(*new))
            writes = frozenset[int]().union(*(g[c] for g, c in zip(groups, chosen, strict=True)))
            combinations.append((writes, to))
            for c, t in zip(chosen, targets, strict=True):
                t[c].update(to)
        reached = tuple({c: frozenset(s) for c, s in t.items()} for t in targets)
        return Move(number, effects, tuple(combinations), reached)


def is_false(expression: Expression) -> bool:
    """Whether an expression is the constant false."""
    return isinstance(expression, Literal) and expression.value is False


def simplified(expression: Expression, types: dict[str, Type]) -> Expression:
    """Fold constants, and resolve `?:` with a constant condition whatever its type.

    The type of the result may differ, which does not change the names read or the truth value.
    """
    result = simplify(expression, types=types)
    while isinstance(result, Conditional) and isinstance(result.condition, Literal):
        result = result.then if result.condition.value else result.otherwise
    return result
