"""Live-variable reduction: dead variables are reset, so that states that differ in them coincide.

The states of a model and of its reduction are strongly bisimilar for the given formulas: they have
the same probabilities, rates, choices, rewards and values of the observed expressions, in every
step. Every PCTL*, CSL and reward property over those expressions has the same value. Properties
that count or list states, or refer to "init", observe all variables, and nothing is reduced.

A dead value that may leave its variable's range is still checked: faults of the model are kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from functools import reduce as fold
from itertools import starmap

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundUpdate,
    Event,
    Observations,
    Variable,
)
from symcheck.semantics.reduction.control_locations import Location, Locations, control_variables
from symcheck.semantics.reduction.live_variables import Liveness, is_safe, liveness
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Name,
    StateOperator,
    Type,
)
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import Tree, children, nodes, reads_rewards, transform

__all__ = ["Reduction", "expanded", "observe", "reduce"]

_TRUE = Literal(True, Type.BOOL)
_MAX_CONDITION_LOCATIONS = 40
"""Do not reset a variable if the condition would list more locations or values."""


def observe(
    model: BoundModel, formulas: Iterable[Expression], labels: Mapping[str, Expression]
) -> Observations:
    """The observations of bound formulas.

    Args:
        model: the model.
        formulas: what is read.
        labels: labels of the properties file. If "init" is among them, the initial states may be
            asked for; else who asks for them observes all variables.
    """
    result: list[Expression] = []
    rewards = False
    for formula in formulas:
        expressions = tuple(_seen(formula, {**model.labels, **labels}))
        if any(e is None for e in expressions):
            return Observations(tuple(Name(v.name) for v in model.variables), True)
        result += [e for e in expressions if e is not None]
        rewards = rewards or any(map(reads_rewards, nodes(formula)))
    return Observations(tuple(dict.fromkeys(result)), rewards)


def _seen(formula: Expression, labels: Mapping[str, Expression]) -> Iterator[Expression | None]:
    """The maximal operator-free state expressions; None if the formula reads states themselves."""
    stack: list[Tree] = [formula]
    while stack:
        node = stack.pop()
        match node:
            case StateOperator() if not node.is_bisimulation_invariant:
                yield None
            case _:
                below = tuple(nodes(node))
                if "init" not in labels and any(
                    isinstance(n, LabelReference) and n.name == "init" for n in below
                ):
                    yield None
                elif _is_state_expression(below):
                    yield expanded(node, labels)  # type: ignore[arg-type]
                else:
                    stack += children(node)


def _is_state_expression(below: Sequence[Tree]) -> bool:
    return all(isinstance(n, Expression) and not isinstance(n, StateOperator) for n in below)


def expanded(expression: Expression, labels: Mapping[str, Expression]) -> Expression | None:
    """An expression with its labels expanded; None if a label is unknown.

    The label "deadlock" becomes a name in quotation marks, which no variable has.
    """
    unknown = False

    def expand_label(node: Tree) -> Tree:
        nonlocal unknown
        if not isinstance(node, LabelReference):
            return node
        unknown = unknown or (node.name != "deadlock" and node.name not in labels)
        return labels.get(node.name, Name(f'"{node.name}"'))

    result = transform(expression, expand_label)
    if any(isinstance(n, LabelReference) for n in nodes(result)):
        result = transform(result, expand_label)
    return None if unknown or any(isinstance(n, LabelReference) for n in nodes(result)) else result


@dataclass(frozen=True, eq=False)
class Reduction:
    """A model that resets dead variables.

    Attributes:
        model: the reduced model.
        liveness: live variables of the model without resets.
        resets: number of assignments that were added or replaced, by variable.
    """

    model: BoundModel
    liveness: Liveness
    resets: Mapping[str, int]

    def __str__(self) -> str:
        where = self.liveness.locations.names
        if not self.resets:
            return "no variable is dead for these properties"
        total = len(self.liveness.live)
        index = {v.name: i for i, v in enumerate(self.model.variables)}
        parts = [
            f"{n} ({sum(self.liveness.is_dead(x, index[n]) for x in self.liveness.live)})"
            for n in self.resets
        ]
        control = ", ".join(where) or "no variable"
        return f"reset where dead: {', '.join(parts)} of {total} locations by {control}"


def reduce(model: BoundModel, observed: Observations) -> Reduction:
    """A model with at most as many states, and the same values of all properties over `observed`.

    A dead variable is reset to its initial value, or to its least value if the model has
    init … endinit. Initial states are unchanged.
    """
    locations = Locations(model, control_variables(model))
    result = liveness(model, observed.expressions, rewards=observed.rewards, locations=locations)
    resets = _Resets(model, result).run()
    return replace(
        resets, model=replace(resets.model, derivation=partial(_reduced, observed=observed))
    )


def _reduced(model: BoundModel, observed: Observations) -> BoundModel:
    return reduce(model, observed).model


class _Resets:
    def __init__(self, model: BoundModel, liveness: Liveness) -> None:
        self.model = model
        self.liveness = liveness
        self.count: dict[str, int] = {}
        # The possible target locations of each update of each event, by source location.
        self.targets_of: dict[tuple[int, int, int], dict[Location, frozenset[Location]]] = {}
        for location, move, participant, effect in liveness.locations.steps():
            targets = self.targets_of.setdefault((move.event, participant, id(effect.update)), {})
            targets[location] = move.targets[participant][effect.control]

    def run(self) -> Reduction:
        events = tuple(self._event(n, e) for n, e in enumerate(self.model.events))
        order = {v.name: self.count[v.name] for v in self.model.variables if v.name in self.count}
        return Reduction(replace(self.model, events=events), self.liveness, order)

    def _event(self, number: int, event: Event) -> Event:
        """Reset a variable in the participants that write it.

        A variable that no participant writes is reset by the one writing most control variables.
        """
        control = self.liveness.locations.control
        written = [
            {i for c in p for u in c.updates for i, _ in u.assignments} for p in event.participants
        ]
        mover = max(range(len(written)), key=lambda p: len(written[p] & set(control)))
        written_or_reset = [set(w) for w in written]
        written_or_reset[mover] |= {
            i for i in range(len(self.model.variables)) if not any(i in w for w in written)
        }
        parts = tuple(
            tuple(
                self._command(number, p, c, sorted(written_or_reset[p] - set(control)))
                for c in commands
            )
            for p, commands in enumerate(event.participants)
        )
        return replace(event, participants=parts)

    def _command(
        self, number: int, participant: int, command: BoundCommand, variables: Sequence[int]
    ) -> BoundCommand:
        updates = (
            self._update(u, self.targets_of.get((number, participant, id(u)), {}), variables)
            for u in command.updates
        )
        return replace(command, updates=tuple(updates))

    def _update(
        self,
        update: BoundUpdate,
        targets_of: Mapping[Location, frozenset[Location]],
        variables: Sequence[int],
    ) -> BoundUpdate:
        assignments = dict(update.assignments)
        for i in variables:
            value = self._value(i, assignments.get(i), targets_of)
            if value is not None:
                assignments[i] = value
                name = self.model.variables[i].name
                self.count[name] = self.count.get(name, 0) + 1
        return replace(update, assignments=tuple(assignments.items()))

    def _value(
        self,
        variable: int,
        written: Expression | None,
        targets_of: Mapping[Location, frozenset[Location]],
    ) -> Expression | None:
        """The expression to assign instead of `written` (None: no assignment); None: no change."""
        dead = [
            x
            for x, targets in targets_of.items()
            if all(self.liveness.is_dead(t, variable) for t in targets)
        ]
        # A variable that is dead before the update too has its reset value already, because the
        # reset value is its initial value.
        begins_reset = self.model.initial is None and written is None
        if not dead or (begins_reset and all(self.liveness.is_dead(x, variable) for x in dead)):
            return None
        v = self.model.variables[variable]
        condition, reset = (
            _condition(dead, list(targets_of), self.liveness.locations.names),
            _reset_value(v),
        )
        if condition is None or written == reset:
            return None
        if written is not None and not is_safe(written, v, self.model.variables):
            if v.low is None or v.high is None or v.type is Type.BOOL:
                return None
            condition = Binary(Operator.AND, condition, _in_range(written, v.low, v.high))
        return _choose(condition, reset, Name(v.name) if written is None else written)


def _reset_value(variable: Variable) -> Expression:
    given = (variable.initial, variable.low, 0)
    return variable.literal(next(value for value in given if value is not None))


def _choose(condition: Expression, reset: Expression, kept: Expression) -> Expression:
    return reset if condition == _TRUE else Conditional(condition, reset, kept)


def _in_range(value: Expression, low: int, high: int) -> Expression:
    """The condition that a value is in a range; a value outside is assigned, which is a fault."""
    return Binary(
        Operator.AND,
        Binary(Operator.GE, value, Literal(low, Type.INT)),
        Binary(Operator.LE, value, Literal(high, Type.INT)),
    )


def _condition(
    chosen: Sequence[Location], possible: Sequence[Location], names: Sequence[str]
) -> Expression | None:
    """The condition that the location is one of `chosen`, given that it is one of `possible`.

    None if the condition would be too large.
    """
    others = set(possible) - set(chosen)
    if not others:
        return _TRUE
    for position in range(len(names)):
        values = {x[position] for x in chosen}
        if not values & {x[position] for x in others} and len(values) <= _MAX_CONDITION_LOCATIONS:
            equal_to = partial(_equal, names[position])
            return _joined(Operator.OR, map(equal_to, sorted(values)))
    if len(chosen) > _MAX_CONDITION_LOCATIONS:
        return None
    equal = (starmap(_equal, zip(names, x, strict=True)) for x in chosen)
    return _joined(Operator.OR, (_joined(Operator.AND, parts) for parts in equal))


def _equal(name: str, value: bool | int) -> Expression:
    return Binary(
        Operator.EQ, Name(name), Literal(value, Type.BOOL if isinstance(value, bool) else Type.INT)
    )


def _joined(operator: Operator, parts: Iterable[Expression]) -> Expression:
    return fold(partial(Binary, operator), parts)
