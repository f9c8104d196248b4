"""Filters: one value from the values of a formula in many states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import isfinite
from typing import Generic, TypeVar, assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.result import Line
from symcheck.check.thresholds import by_rationals
from symcheck.engines.base import Number, StateSet, Values, bracket
from symcheck.errors import Diagnostic, InputError, SymcheckError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import is_rational, rationals
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics import rational_limits
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, to_float
from symcheck.syntax.ast import Expression, Filter

__all__ = [
    "AppliedFilter",
    "Bounds",
    "Condition",
    "FilterResult",
    "Numeric",
    "truth_lines",
    "value_lines",
]

_TINY = 2 * UNDERFLOW_MARGIN

F = TypeVar("F")
Bounds = tuple[Number, Number]


@dataclass(frozen=True)
class FilterResult(Generic[F]):
    """The result of a filter.

    Attributes:
        value: bounds (lower, upper), a bool, or two pairs of bounds (range); None if the filter has
            no single value.
        per_state: the value in each state, for a filter within a larger formula: a set of states or
            numbers.
        rounded: whether `value` was computed in floating-point arithmetic.
    """

    value: bool | Bounds | tuple[Bounds, Bounds] | None
    per_state: F
    rounded: bool = False


Condition = FilterResult[StateSet]
Numeric = FilterResult[Values]


@dataclass(frozen=True, eq=False)
class AppliedFilter:
    """A filter, the states that it selects, and how to evaluate its formula.

    Attributes:
        context: the engine, and the log for printed lines.
        node: the filter.
        states: the states that the filter selects.
        satisfying: gives the states that satisfy a boolean formula.
        numbers: gives the values of a numeric formula.
        exactly: gives the states of the filter by rational arithmetic, and logs them.
    """

    context: Context
    node: Filter
    states: StateSet
    satisfying: Callable[[Expression], StateSet]
    numbers: Callable[[Expression], Values]
    exactly: Callable[[], StateSet] | None = None

    def condition(self) -> Condition:
        """The result of a filter whose type is bool.

        Raises:
            InputError: no state is selected, or several for 'state', or the formula has a wrong
                type.
        """
        engine, formula, states = self.context.engine, self.node.formula, self._selected()
        match self.node.operator:
            case "argmin" | "argmax":
                return self._extreme(self.numbers(formula), states)
            case "print" | "printall" as operator:
                holds = self.satisfying(formula)
                shown = states if operator == "printall" else states & holds
                self.context.log.lines.extend(truth_lines(self.context, holds, shown))
                return FilterResult(None, holds)
            case "forall":
                value = states <= self.satisfying(formula)
            case "exists":
                value = bool(self.satisfying(formula) & states)
            case "state" | "first":
                value = bool(self.satisfying(formula) & self._one(states))
            case "min" | "max" | "sum" | "avg" | "count" | "range":
                raise self._wrong_type("bool")
            case operator:
                assert_never(operator)
        return FilterResult(value, engine.all if value else engine.none)

    def number(self) -> Numeric:
        """The result of a filter whose type is a number; raises InputError as `condition`."""
        formula, states, operator = self.node.formula, self._selected(), self.node.operator
        match operator:
            case "count":
                count = (self.satisfying(formula) & states).count
                return self._constant((count, count), rounded=False)
            case "forall" | "exists" | "argmin" | "argmax":
                raise self._wrong_type("number")
            case _:
                pass
        values = self.numbers(formula)
        rounded = values.rounded(states)
        match operator:
            case "range":
                ends = values.minimum(states), values.maximum(states)
                return FilterResult(ends, values, rounded)
            case "print" | "printall":
                other, maybe = values.compare("!=", 0)
                shown = states if operator == "printall" else states & (other | maybe)
                self.context.log.lines.extend(value_lines(self.context, values, shown))
                return FilterResult(None, values)
            case "max":
                bounds = values.maximum(states)
            case "sum":
                bounds = values.total(states)
            case "avg":
                low, high = values.total(states)
                bounds = _share(low, states.count)[0], _share(high, states.count)[1]
            case "min":
                bounds = values.minimum(states)
            case "state" | "first":
                one = self._one(states)
                bounds, rounded = values.minimum(one), values.rounded(one)
            case _:
                assert_never(operator)
        if operator in ("sum", "avg"):
            rounded = rounded or values.is_point
        return self._constant(bounds, rounded)

    def _constant(self, bounds: Bounds, rounded: bool) -> Numeric:
        engine, value = self.context.engine, bounds[0]
        per_state = (
            engine.rationals(rationals([value]))
            if isinstance(value, int | Fraction)
            else engine.constant(*bounds, rounded=rounded)
        )
        return FilterResult(bounds, per_state, rounded)

    def _extreme(self, values: Values, states: StateSet) -> Condition:
        """The states whose value may be the least (greatest), given its accuracy."""
        if self.node.operator == "argmin":
            least, most = values.minimum(states)
            near, sure = values.compare("<=", most), values.compare("<=", least)[0]
        else:
            least, most = values.maximum(states)
            near, sure = values.compare(">=", least), values.compare(">=", most)[0]
        extreme = (near[0] | near[1]) & states
        if self.exactly is not None and self._is_undecided(values, extreme, sure):
            # Values that are too close are compared as rationals, where the model is small enough.
            exact = by_rationals(self.context.engine, self.exactly)
            if not isinstance(exact, SymcheckError):
                return FilterResult(None, exact)
        self.context.log.lines.extend(value_lines(self.context, values, extreme))
        return FilterResult(None, extreme)

    def _is_undecided(self, values: Values, extreme: StateSet, sure: StateSet) -> bool:
        """Whether rationals should tell which of the states have an extreme value."""
        if extreme.count < 2:
            return False
        low, high = values.minimum(extreme)[0], values.maximum(extreme)[1]
        tiny = low != high and low >= -_TINY and high <= _TINY
        return tiny or (
            self.context.engine.states <= rational_limits.EXTREME_STATES and not extreme <= sure
        )

    def _selected(self) -> StateSet:
        if self.states:
            return self.states
        message = "no state satisfies the condition of this filter"
        raise InputError(Diagnostic(message, self.node.span, "filter-empty"))

    def _one(self, states: StateSet) -> StateSet:
        """The first state, which must be the only one for 'state'."""
        if self.node.operator == "state" and states.count != 1:
            message = f"this filter selects {states.count} states, not one"
            hint = "filter(first, …), filter(min, …) or filter(range, …) take several states"
            raise InputError(Diagnostic(message, self.node.span, "filter-state", hint))
        return self.context.engine.first(states)

    def _wrong_type(self, kind: str) -> InputError:
        message = f"the filter '{self.node.operator}' does not take a {kind}"
        return InputError(Diagnostic(message, self.node.span, "filter-type"))


def truth_lines(context: Context, formula: StateSet, states: StateSet) -> list[Line]:
    """Whether a formula holds in each of the states, in the order of indices."""
    members = context.engine.to_bools(formula)[context.engine.to_bools(states)]
    return _lines(context, states, members.tolist())


def value_lines(context: Context, formula: Values, states: StateSet) -> list[Line]:
    """The value of a formula in each of the states, in the order of indices."""
    low, high = formula.at(states)
    if not context.engine.is_rational and is_rational(low):
        low = high = np.array([v if _is_large_whole(v) else to_float(v) for v in low], object)
    values = [_middle(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    return _lines(context, states, values)


def _lines(context: Context, states: StateSet, values: Sequence[bool | float]) -> list[Line]:
    engine = context.engine
    numbers = engine.numbers(states).tolist()
    return [
        Line(i, s, v) for i, s, v in zip(numbers, engine.valuations(states), values, strict=True)
    ]


def _share(total: Number, count: int) -> Bounds:
    """Bounds on the total divided by a count; they are equal if it is a number of the type."""
    if isinstance(total, Fraction) or not isfinite(total):
        return total / count, total / count
    return bracket(Fraction(total) / count)


def _is_large_whole(value: float | Fraction) -> bool:
    """Whether a value is an int that no double need be."""
    return isinstance(value, Fraction) and value.denominator == 1 and abs(value) > LARGEST_WHOLE


def _middle(low: float, high: float) -> float:
    return low if low == high else (low + high) / 2
