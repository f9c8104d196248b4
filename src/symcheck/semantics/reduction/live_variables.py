"""Live variables of each control location: variables that may be read before they are written.

The analysis is a backward data flow over the control locations. Guards, probabilities, the right
sides of assignments, the rewards (if the properties read them) and the state formulas of the
properties read variables; each is simplified at the location first.
Source: M. Bozga, J.-C. Fernandez, L. Ghirvu: State space reduction based on live variables
analysis. SAS 1999, LNCS 1694.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.reduction.control_locations import (
    Location,
    Locations,
    Move,
    control_variables,
)
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.traversal import names, nodes

__all__ = ["Liveness", "is_safe", "liveness", "may_be_undefined"]


@dataclass(frozen=True, eq=False)
class Liveness:
    """The live variables of a model.

    Attributes:
        live: for each control location that may be reached, the indices of its live variables.
            Control variables are always live.
    """

    locations: Locations = field(repr=False)
    live: Mapping[Location, frozenset[int]]

    def is_dead(self, location: Location, variable: int) -> bool:
        """Whether the value of a variable at a location is never read."""
        return variable not in self.live.get(
            location, frozenset(range(len(self.locations.model.variables)))
        )


def liveness(
    model: BoundModel,
    observed: Sequence[Expression],
    *,
    rewards: bool,
    locations: Locations | None = None,
) -> Liveness:
    """Compute the live variables of a model.

    Args:
        observed: state expressions that the properties read.
        rewards: the properties read rewards.
        locations: the control locations of the model; None: they are computed.

    Source: Bozga, Fernandez & Ghirvu (SAS 1999).
    """
    locations = locations or Locations(model, control_variables(model))
    return _Analysis(model, locations, tuple(observed), rewards).run()


class _Analysis:
    def __init__(
        self,
        model: BoundModel,
        locations: Locations,
        observed: tuple[Expression, ...],
        rewards: bool,
    ) -> None:
        self.model = model
        self.locations = locations
        self.observed = observed
        # Rewards are evaluated in every state, whether or not a property reads them: the variables
        # of rewards that may be undefined are live.
        items = (i for r in model.rewards for i in r.items)
        self.rewards = [
            i
            for i in items
            if rewards or any(may_be_undefined(n) for e in (i.guard, i.value) for n in nodes(e))
        ]
        self.index = {v.name: i for i, v in enumerate(model.variables)}
        self.is_safe: dict[tuple[int, int], bool] = {}

    def run(self) -> Liveness:
        control = frozenset(self.locations.control)
        live = {
            location: control | self._reads_at(location, moves)
            for location, moves in self.locations.moves.items()
        }
        before: dict[Location, set[Location]] = {location: set() for location in live}
        for location, moves in self.locations.moves.items():
            for move in moves:
                for _, targets in move.combinations:
                    for t in targets:
                        before[t].add(location)
        work = dict.fromkeys(live)
        while work:
            location, _ = work.popitem()
            grown = live[location].union(
                *(self._live_through(m, location, live) for m in self.locations.moves[location])
            )
            if grown != live[location]:
                live[location] = grown
                work.update(dict.fromkeys(before[location]))
        return Liveness(self.locations, live)

    def _reads(self, expression: Expression, location: Location) -> frozenset[int]:
        found = names(self.locations.residual(expression, location))
        return frozenset(self.index[n] for n in found if n in self.index)

    def _reads_at(self, location: Location, moves: tuple[Move, ...]) -> frozenset[int]:
        """The variables that are read at a location, independently of its successors."""
        found = frozenset[int]().union(*(self._reads(e, location) for e in self.observed))
        for reward in self.rewards:
            match self.locations.residual(reward.guard, location):
                case Literal(False):
                    continue
                case _:
                    found |= self._reads(reward.guard, location) | self._reads(
                        reward.value, location
                    )
        for move in moves:
            for effects in move.effects:
                for e in effects:
                    found |= self._reads(e.command.guard, location) | self._reads(
                        e.update.probability, location
                    )
                    for i, value in e.update.assignments:
                        if i in self.locations.control or not self._is_safe(i, value):
                            found |= self._reads(value, location)
        return found

    def _is_safe(self, variable: int, value: Expression) -> bool:
        key = variable, id(value)
        if key not in self.is_safe:
            self.is_safe[key] = is_safe(value, self.model.variables[variable], self.model.variables)
        return self.is_safe[key]

    def _live_through(
        self, move: Move, location: Location, live: Mapping[Location, frozenset[int]]
    ) -> frozenset[int]:
        """The variables that are live because of a move.

        They are live at a target and not written by the move, or read to assign a live variable.
        """
        found = frozenset[int]()
        for writes, targets in move.combinations:
            for t in targets:
                found |= live[t] - writes
        for effects, targets_by in zip(move.effects, move.targets, strict=True):
            for e in effects:
                live_after = frozenset[int]().union(*(live[t] for t in targets_by[e.control]))
                for i, value in e.update.assignments:
                    if i in live_after and i not in self.locations.control:
                        found |= self._reads(value, location)
        return found


def is_safe(value: Expression, variable: Variable, variables: Sequence[Variable]) -> bool:
    """Whether an assigned value is certainly defined and within the variable's range.

    Such an assignment cannot be a fault of the model, so it may be omitted.
    """
    if variable.type is Type.BOOL or variable.low is None or variable.high is None:
        within = True
    else:
        low, high = _interval(value, {v.name: v for v in variables})
        within = (
            low is not None and high is not None and variable.low <= low and high <= variable.high
        )
    return within and not any(may_be_undefined(n) for n in nodes(value))


_DEFINED = frozenset(
    {
        *(o for o in Operator if o.is_boolean),
        *(Operator.PLUS, Operator.MINUS, Operator.TIMES),
        *(Function.MIN, Function.MAX, Function.FLOOR, Function.CEIL, Function.ROUND),
    }
)
"""Operators and functions that have a finite value if their operands have one."""


def may_be_undefined(node: object) -> bool:
    """Whether a node may have no finite value for some operands; True for unknown operators."""
    return (isinstance(node, Binary) and node.operator not in _DEFINED) or (
        isinstance(node, Call) and node.function not in _DEFINED
    )


Interval = tuple[int | None, int | None]


def _interval(value: Expression, variables: Mapping[str, Variable]) -> Interval:
    """Lower and upper bound of an int expression; None: unbounded or unknown."""
    match value:
        case Literal(int() as n, Type.INT):
            return n, n
        case Name(name):
            return variables[name].low, variables[name].high
        case Unary(UnaryOperator.MINUS, operand):
            low, high = _interval(operand, variables)
            return None if high is None else -high, None if low is None else -low
        case Binary(Operator.PLUS | Operator.MINUS as operator, left, right):
            a, b = (
                _interval(left, variables),
                _interval(
                    right if operator is Operator.PLUS else Unary(UnaryOperator.MINUS, right),
                    variables,
                ),
            )
            return None if a[0] is None or b[0] is None else a[0] + b[0], None if a[1] is None or b[
                1
            ] is None else a[1] + b[1]
        case Binary(Operator.TIMES, left, right):
            ends = [_interval(left, variables), _interval(right, variables)]
            products = [x * y for x in ends[0] for y in ends[1] if x is not None and y is not None]
            return (min(products), max(products)) if len(products) == 4 else (None, None)
        case Conditional(_, then, otherwise):
            return _hull(_interval(then, variables), _interval(otherwise, variables))
        case Call(Function.MIN | Function.MAX as function, arguments):
            return _extreme(function is Function.MIN, [_interval(a, variables) for a in arguments])
        case _:
            return None, None


def _hull(a: Interval, b: Interval) -> Interval:
    return None if a[0] is None or b[0] is None else min(a[0], b[0]), None if a[1] is None or b[
        1
    ] is None else max(a[1], b[1])


def _extreme(least: bool, parts: Sequence[Interval]) -> Interval:
    lows, highs = (
        [p[0] for p in parts if p[0] is not None],
        [p[1] for p in parts if p[1] is not None],
    )
    if least:
        return min(lows) if len(lows) == len(parts) else None, min(highs, default=None)
    return max(lows, default=None), max(highs) if len(highs) == len(parts) else None
