"""Live-variable reduction: what nothing will read again is set to one value, so that states that differ in it become one.

The states that a model and its reduction give are strongly bisimilar for the formulas in question: they step alike, in
every number of steps, with the same probabilities, rates, choices, rewards and truth of the observed expressions. So
every PCTL*, CSL and reward property over those expressions has the same value. Where no formula counts steps, steps that
nothing observes are passed over first (see `symcheck.semantics.reduction.stutter_reduction`); then the states are stutter bisimilar.
Properties that count or list states, or speak of "init", observe all variables, and nothing is reduced for them.

A dead value is still checked against its variable's range, wherever it might leave it: a fault in the model stays one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate, Event, Variable
from symcheck.semantics.reduction.control_locations import Location, Locations, control_variables
from symcheck.semantics.reduction.live_variables import Liveness, harmless, liveness
from symcheck.semantics.reduction.stutter_reduction import counts_steps, shorten
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Expression,
    Filter,
    LabelReference,
    Literal,
    Name,
    RewardBound,
    StateFilter,
    StateOperator,
    Type,
)
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import Tree, children, nodes, transform

__all__ = ["Observed", "Reduction", "observe", "reduce"]

_KEPT_BY_BISIMULATION = {"min", "max", "range", "forall", "exists"}
_TRUE = Literal(True, Type.BOOL)
_LONGEST_CONDITION = 40  # locations in a condition on which a variable is reset


@dataclass(frozen=True, slots=True)
class Observed:
    """What properties see of a state: the values of `expressions`, and `rewards` or not. `steps`: they may count steps."""

    expressions: tuple[Expression, ...]
    rewards: bool
    steps: bool = True


def observe(
    model: BoundModel, formulas: Iterable[Expression], labels: Mapping[str, Expression]
) -> Observed:
    """What bound formulas observe. `labels`: those of the properties file and of the model."""
    found: list[Expression] = []
    formulas = tuple(formulas)
    rewards, steps = False, not formulas or any(map(counts_steps, formulas))
    for formula in formulas:
        own = tuple(_seen(formula, {**model.labels, **labels}))
        if any(e is None for e in own):
            return Observed(tuple(Name(v.name) for v in model.variables), True)
        found += [e for e in own if e is not None]
        rewards = rewards or any(map(_reads_rewards, nodes(formula)))
    return Observed(tuple(dict.fromkeys(found)), rewards, steps)


def _seen(formula: Expression, labels: Mapping[str, Expression]) -> Iterator[Expression | None]:
    """The largest state expressions without operators; None where the states themselves are spoken of."""
    stack: list[Tree] = [formula]
    while stack:
        node = stack.pop()
        match node:
            case Filter(operator, _, _) if operator not in _KEPT_BY_BISIMULATION:
                yield None
            case StateFilter(operators, _, _) if not operators:
                yield None
            case _:
                below = tuple(nodes(node))
                if any(isinstance(n, LabelReference) and n.name == "init" for n in below):
                    yield None
                elif _is_state_expression(below):
                    yield _expanded(node, labels)  # type: ignore[arg-type]
                else:
                    stack += children(node)


def _reads_rewards(node: Tree) -> bool:
    return isinstance(node, RewardBound) or (isinstance(node, StateOperator) and node.reads_rewards)


def _is_state_expression(below: Sequence[Tree]) -> bool:
    return all(isinstance(n, Expression) and not isinstance(n, StateOperator) for n in below)


def _expanded(expression: Expression, labels: Mapping[str, Expression]) -> Expression | None:
    """Labels replaced by what they stand for; "deadlock" by a name that no variable has. None for an unknown label."""
    unknown = False

    def put(node: Tree) -> Tree:
        nonlocal unknown
        if not isinstance(node, LabelReference):
            return node
        unknown = unknown or (node.name != "deadlock" and node.name not in labels)
        return labels.get(node.name, Name(f'"{node.name}"'))

    whole = transform(expression, put)
    if any(isinstance(n, LabelReference) for n in nodes(whole)):
        whole = transform(whole, put)
    return None if unknown or any(isinstance(n, LabelReference) for n in nodes(whole)) else whole


@dataclass(frozen=True, eq=False)
class Reduction:
    """A model that resets dead variables. `resets`: how many assignments were added or replaced, for each variable.

    passed: how many control locations the model no longer stops at. `liveness` is of the model without resets.
    """

    model: BoundModel
    liveness: Liveness
    resets: Mapping[str, int]
    passed: int = 0

    @property
    def canonical(self) -> tuple[tuple[int, Expression], ...]:
        """The same as assignments to be applied to every successor (see `symcheck.explicit.build.explore`) of
        `liveness.locations.model`.

        It reads the location that is reached, so it resets at least what `model` does.
        """
        found = []
        for i, variable in enumerate(self.liveness.locations.model.variables):
            dead = [x for x in self.liveness.live if self.liveness.dead(x, i)]
            condition = (
                _condition(dead, list(self.liveness.live), self.liveness.locations.names)
                if dead
                else None
            )
            if condition is not None:
                found.append((i, _choose(condition, _canonical(variable), Name(variable.name))))
        return tuple(found)

    def __str__(self) -> str:
        where = self.liveness.locations.names
        passed = (
            f"{self.passed} locations passed over where nothing is seen; " if self.passed else ""
        )
        if not self.resets:
            return f"{passed}nothing is ever dead for these properties"
        total = len(self.liveness.live)
        index = {v.name: i for i, v in enumerate(self.model.variables)}
        parts = [
            f"{n} ({sum(self.liveness.dead(x, index[n]) for x in self.liveness.live)})"
            for n in self.resets
        ]
        return f"{passed}reset where dead: {', '.join(parts)} of {total} locations by {', '.join(where) or 'no variable'}"


def reduce(model: BoundModel, observed: Observed) -> Reduction:
    """A model with fewer states, and the same values of all properties that observe no more than `observed`.

    Initial states are left as they are. Variables are reset to their initial value (or least one).
    """
    locations = Locations(model, control_variables(model))
    passed = 0
    if not observed.steps:
        shortened = shorten(model, locations, observed.expressions)
        passed = len(shortened.passed)
        if passed:
            model = shortened.model
            locations = Locations(model, control_variables(model))
    found = liveness(model, observed.expressions, rewards=observed.rewards, locations=locations)
    made = _Resets(model, found).run()
    return replace(
        made,
        model=replace(made.model, derivation=partial(_reduced, observed=observed)),
        passed=passed,
    )


def _reduced(model: BoundModel, observed: Observed) -> BoundModel:
    return reduce(model, observed).model


class _Resets:
    def __init__(self, model: BoundModel, found: Liveness) -> None:
        self.model = model
        self.found = found
        self.count: dict[str, int] = {}
        # For each update of each event: where it may lead, from each location at which it may happen.
        self.after: dict[tuple[int, int, int], dict[Location, frozenset[Location]]] = {}
        for location, moves in found.locations.moves.items():
            for move in moves:
                for participant, effects in enumerate(move.effects):
                    for e in effects:
                        key = move.event, participant, id(e.update)
                        self.after.setdefault(key, {})[location] = move.targets[participant][
                            e.control
                        ]

    def run(self) -> Reduction:
        events = tuple(self._event(n, e) for n, e in enumerate(self.model.events))
        order = {v.name: self.count[v.name] for v in self.model.variables if v.name in self.count}
        return Reduction(replace(self.model, events=events), self.found, order)

    def _event(self, number: int, event: Event) -> Event:
        """Who writes a variable also resets it; what nobody writes is reset by the participant that moves the control."""
        control = self.found.locations.control
        written = [
            {i for c in p for u in c.updates for i, _ in u.assignments} for p in event.participants
        ]
        mover = max(range(len(written)), key=lambda p: len(written[p] & set(control)))
        own = [set(w) for w in written]
        own[mover] |= {
            i for i in range(len(self.model.variables)) if not any(i in w for w in written)
        }
        parts = tuple(
            tuple(self._command(number, p, c, sorted(own[p] - set(control))) for c in commands)
            for p, commands in enumerate(event.participants)
        )
        return replace(event, participants=parts)

    def _command(
        self, number: int, participant: int, command: BoundCommand, variables: Sequence[int]
    ) -> BoundCommand:
        updates = (
            self._update(u, self.after.get((number, participant, id(u)), {}), variables)
            for u in command.updates
        )
        return replace(command, updates=tuple(updates))

    def _update(
        self,
        update: BoundUpdate,
        after: Mapping[Location, frozenset[Location]],
        variables: Sequence[int],
    ) -> BoundUpdate:
        assignments = dict(update.assignments)
        for i in variables:
            value = self._value(i, assignments.get(i), after)
            if value is not None:
                assignments[i] = value
                name = self.model.variables[i].name
                self.count[name] = self.count.get(name, 0) + 1
        return replace(update, assignments=tuple(assignments.items()))

    def _value(
        self,
        variable: int,
        written: Expression | None,
        after: Mapping[Location, frozenset[Location]],
    ) -> Expression | None:
        """What to assign instead of `written` (None: nothing is); None to leave it as it is."""
        dead = [
            x for x, targets in after.items() if all(self.found.dead(t, variable) for t in targets)
        ]
        # What was dead before has been reset before, where the variable begins with that value.
        begins_reset = self.model.initial is None and written is None
        if not dead or (begins_reset and all(self.found.dead(x, variable) for x in dead)):
            return None
        v = self.model.variables[variable]
        condition, reset = _condition(dead, list(after), self.found.locations.names), _canonical(v)
        if condition is None or written == reset:
            return None
        if written is not None and not harmless(written, v, self.model.variables):
            if v.low is None or v.high is None or v.type is Type.BOOL:
                return None
            condition = Binary(Operator.AND, condition, _within(written, v.low, v.high))
        return _choose(condition, reset, Name(v.name) if written is None else written)


def _canonical(variable: Variable) -> Expression:
    value = (
        variable.initial
        if variable.initial is not None
        else variable.low
        if variable.low is not None
        else 0
    )
    return (
        Literal(bool(value), Type.BOOL)
        if variable.type is Type.BOOL
        else Literal(int(value), Type.INT)
    )


def _choose(condition: Expression, reset: Expression, kept: Expression) -> Expression:
    return reset if condition == _TRUE else Conditional(condition, reset, kept)


def _within(value: Expression, low: int, high: int) -> Expression:
    """That a value is in a range: where it is not, it is assigned after all, and the fault is found."""
    return Binary(
        Operator.AND,
        Binary(Operator.GE, value, Literal(low, Type.INT)),
        Binary(Operator.LE, value, Literal(high, Type.INT)),
    )


def _condition(
    chosen: Sequence[Location], possible: Sequence[Location], names: Sequence[str]
) -> Expression | None:
    """That the location is one of `chosen`, given that it is one of `possible`; None where that takes too long to say."""
    others = set(possible) - set(chosen)
    if not others:
        return _TRUE
    for place in range(len(names)):
        values = {x[place] for x in chosen}
        if not values & {x[place] for x in others} and len(values) <= _LONGEST_CONDITION:
            return _any(_equal(names[place], v) for v in sorted(values))
    if len(chosen) > _LONGEST_CONDITION:
        return None
    return _any(_all(_equal(n, v) for n, v in zip(names, x, strict=True)) for x in chosen)


def _equal(name: str, value: bool | int) -> Expression:
    return Binary(
        Operator.EQ, Name(name), Literal(value, Type.BOOL if isinstance(value, bool) else Type.INT)
    )


def _any(parts: Iterable[Expression]) -> Expression:
    first, *rest = parts
    for part in rest:
        first = Binary(Operator.OR, first, part)
    return first


def _all(parts: Iterable[Expression]) -> Expression:
    first, *rest = parts
    for part in rest:
        first = Binary(Operator.AND, first, part)
    return first
