"""Live variables of each control location: variables that may be read before they are written.

The analysis is a backward data flow over the control locations. Guards, probabilities, the right
sides of assignments, the rewards (if the properties read them) and the state formulas of the
properties read variables; each is simplified at the location first.
Source: M. Bozga, J.-C. Fernandez, L. Ghirvu: State space reduction based on live variables
analysis. SAS 1999, LNCS 1694.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import product
from math import inf, isfinite
from typing import assert_never

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.reduction.control_locations import (
    Location,
    Locations,
    Move,
    control_variables,
    is_false,
)
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    ExpressionNode,
    Literal,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.traversal import names, nodes

__all__ = ["Liveness", "int_bounds", "is_safe", "liveness", "may_be_undefined"]


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
        model: the model.
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
        result = names(self.locations.residual(expression, location))
        return frozenset(self.index[n] for n in result if n in self.index)

    def _reads_at(self, location: Location, moves: tuple[Move, ...]) -> frozenset[int]:
        """The variables that are read at a location, independently of its successors."""
        read = frozenset[int]().union(*(self._reads(e, location) for e in self.observed))
        for reward in self.rewards:
            if not is_false(self.locations.residual(reward.guard, location)):
                read |= self._reads(reward.guard, location) | self._reads(reward.value, location)
        for move in moves:
            for effects in move.effects:
                for e in effects:
                    read |= self._reads(e.command.guard, location)
                    read |= self._reads(e.update.probability, location)
                    if e.update.upper is not None:
                        read |= self._reads(e.update.upper, location)
                    for i, value in e.update.assignments:
                        if i in self.locations.control or not self._is_safe(i, value):
                            read |= self._reads(value, location)
        return read

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
        read = frozenset[int]()
        for writes, targets in move.combinations:
            for t in targets:
                read |= live[t] - writes
        for effects, targets_by in zip(move.effects, move.targets, strict=True):
            for e in effects:
                live_after = frozenset[int]().union(*(live[t] for t in targets_by[e.control]))
                for i, value in e.update.assignments:
                    if i in live_after and i not in self.locations.control:
                        read |= self._reads(value, location)
        return read


def is_safe(value: Expression, variable: Variable, variables: Sequence[Variable]) -> bool:
    """Whether an assigned value is certainly defined and within the variable's range.

    Such an assignment cannot be a fault of the model, so it may be omitted.
    """
    within = True
    if variable.type is not Type.BOOL and variable.low is not None and variable.high is not None:
        low, high = int_bounds(value, variables)
        within = variable.low <= low and high <= variable.high
    return within and not any(may_be_undefined(n) for n in nodes(value))


def int_bounds(value: Expression, variables: Sequence[Variable]) -> Interval:
    """Lower and upper bound of an int expression, infinite where it is unbounded or unknown."""
    return _interval(value, {v.name: v for v in variables})


def may_be_undefined(node: object) -> bool:
    """Whether a node may have no finite value for some operands."""
    match node:
        case Binary(operation) | Call(operation):
            return not operation.is_total
        case _:
            return False


Interval = tuple[float, float]
"""Bounds of the values of an expression, infinite where it is unbounded or unknown."""


def _interval(value: Expression, variables: Mapping[str, Variable]) -> Interval:
    """Lower and upper bound of an int expression."""

    def inner(*parts: Expression) -> tuple[tuple[float, ...], tuple[float, ...]]:
        lows, highs = zip(*(_interval(p, variables) for p in parts), strict=True)
        return lows, highs

    match value:
        case Literal(int() as n, Type.INT):
            return n, n
        case Name(name):
            low, high = variables[name].low, variables[name].high
            return -inf if low is None else low, inf if high is None else high
        case Unary(UnaryOperator.MINUS, operand):
            (least,), (largest,) = inner(operand)
            return -largest, -least
        case Binary(Operator.PLUS, left, right):
            lows, highs = inner(left, right)
            return sum(lows), sum(highs)
        case Binary(Operator.MINUS, left, right):
            lows, highs = inner(left, right)
            return lows[0] - highs[1], highs[0] - lows[1]
        case Binary(Operator.TIMES, left, right):
            ends = zip(*inner(left, right), strict=True)
            products = [x * y for x, y in product(*ends)]
            return (min(products), max(products)) if all(map(isfinite, products)) else (-inf, inf)
        case Conditional(_, then, otherwise):
            lows, highs = inner(then, otherwise)
            return min(lows), max(highs)
        case Call(Function.MIN | Function.MAX as function, arguments):
            extreme = min if function is Function.MIN else max
            lows, highs = inner(*arguments)
            return extreme(lows), extreme(highs)
        case ExpressionNode():
            return -inf, inf
        case _:
            assert_never(value)
