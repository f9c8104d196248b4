"""Filters: one value from the values of a formula in many states."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from symcheck.check.context import Context
from symcheck.check.result import Line
from symcheck.engines.base import Number, StateSet, Values
from symcheck.errors import Diagnostic, InputError
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
    """

    context: Context
    node: Filter
    states: StateSet
    satisfying: Callable[[Expression], StateSet]
    numbers: Callable[[Expression], Values]

    def condition(self) -> Condition:
        """The result of a filter whose type is bool.

        Raises:
            InputError: no state is selected, or several for 'state', or the formula has a wrong
                type.
        """
        operator, formula, states = self.node.operator, self.node.formula, self._selected()
        if operator in ("argmin", "argmax"):
            return _arguments(self.context, operator, self.numbers(formula), states)
        if operator not in _BOOLEAN:
            raise self._wrong_type("bool")
        return _BOOLEAN[operator](self.context, self.node, self.satisfying(formula), states)

    def number(self) -> Numeric:
        """The result of a filter whose type is a number; raises InputError as `condition`."""
        operator, formula, states = self.node.operator, self.node.formula, self._selected()
        if operator == "count":
            count = (self.satisfying(formula) & states).count
            return _number(self.context, (count, count), rounded=False)
        if operator not in _NUMERIC:
            raise self._wrong_type("number")
        return _NUMERIC[operator](self.context, self.node, self.numbers(formula), states)

    def _selected(self) -> StateSet:
        if self.states:
            return self.states
        message = "no state satisfies the condition of this filter"
        raise InputError(Diagnostic(message, self.node.span, "filter-empty"))

    def _wrong_type(self, kind: str) -> InputError:
        message = f"the filter '{self.node.operator}' does not take a {kind}"
        return InputError(Diagnostic(message, self.node.span, "filter-type"))


def _truth(context: Context, value: bool) -> Condition:
    return FilterResult(value, context.engine.all if value else context.engine.none)


def _number(context: Context, bounds: Bounds, rounded: bool) -> Numeric:
    return FilterResult(bounds, context.engine.constant(*bounds, rounded=rounded), rounded)


def _one_bool(context: Context, _: Filter, formula: StateSet, states: StateSet) -> Condition:
    return _truth(context, bool(formula & states))


def _state_bool(context: Context, node: Filter, formula: StateSet, states: StateSet) -> Condition:
    return _one_bool(context, node, formula, _single(node, states))


def _first_bool(context: Context, node: Filter, formula: StateSet, states: StateSet) -> Condition:
    return _one_bool(context, node, formula, context.engine.first(states))


def _forall(context: Context, _: Filter, formula: StateSet, states: StateSet) -> Condition:
    return _truth(context, states <= formula)


def _print_bool(context: Context, node: Filter, formula: StateSet, states: StateSet) -> Condition:
    wanted = states if node.operator == "printall" else states & formula
    context.log.lines.extend(truth_lines(context, formula, wanted))
    return FilterResult(None, formula)


def _state(context: Context, node: Filter, formula: Values, states: StateSet) -> Numeric:
    return _number(context, formula.minimum(_single(node, states)), formula.rounded(states))


def _first(context: Context, _: Filter, formula: Values, states: StateSet) -> Numeric:
    first = context.engine.first(states)
    return _number(context, formula.minimum(first), formula.rounded(first))


def _minimum(context: Context, _: Filter, formula: Values, states: StateSet) -> Numeric:
    return _number(context, formula.minimum(states), formula.rounded(states))


def _maximum(context: Context, _: Filter, formula: Values, states: StateSet) -> Numeric:
    return _number(context, formula.maximum(states), formula.rounded(states))


def _sum(context: Context, _: Filter, formula: Values, states: StateSet) -> Numeric:
    return _number(context, formula.total(states), formula.rounded(states))


def _average(context: Context, _: Filter, formula: Values, states: StateSet) -> Numeric:
    low, high = formula.total(states)
    return _number(context, (low / states.count, high / states.count), formula.rounded(states))


def _range(_: Context, __: Filter, formula: Values, states: StateSet) -> Numeric:
    return FilterResult(
        (formula.minimum(states), formula.maximum(states)), formula, formula.rounded(states)
    )


def _arguments(context: Context, operator: str, formula: Values, states: StateSet) -> Condition:
    """The states whose value may be the least (greatest), given its accuracy."""
    if operator == "argmin":
        sure, maybe = formula.compare("<=", formula.minimum(states)[1])
    else:
        sure, maybe = formula.compare(">=", formula.maximum(states)[0])
    extreme = (sure | maybe) & states
    context.log.lines.extend(value_lines(context, formula, extreme))
    return FilterResult(None, extreme)


def _print(context: Context, node: Filter, formula: Values, states: StateSet) -> Numeric:
    wanted = states if node.operator == "printall" else states & formula.compare("!=", 0)[0]
    context.log.lines.extend(value_lines(context, formula, wanted))
    return FilterResult(None, formula)


def truth_lines(context: Context, formula: StateSet, states: StateSet) -> list[Line]:
    """Whether a formula holds in each of the states, in the order of indices."""
    members = context.engine.to_bools(formula)[context.engine.to_bools(states)]
    return _lines(context, states, members.tolist())


def value_lines(context: Context, formula: Values, states: StateSet) -> list[Line]:
    """The value of a formula in each of the states, in the order of indices."""
    low, high = formula.at(states)
    values = [_middle(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    return _lines(context, states, values)


def _lines(context: Context, states: StateSet, values: Sequence[bool | float]) -> list[Line]:
    engine = context.engine
    numbers = engine.numbers(states).tolist()
    return [
        Line(i, s, v) for i, s, v in zip(numbers, engine.valuations(states), values, strict=True)
    ]


def _middle(low: float, high: float) -> float:
    return low if low == high else (low + high) / 2


def _single(node: Filter, states: StateSet) -> StateSet:
    if states.count != 1:
        hint = "filter(first, …), filter(min, …) or filter(range, …) take several states"
        raise InputError(
            Diagnostic(
                f"this filter selects {states.count} states, not one",
                node.span,
                "filter-state",
                hint,
            )
        )
    return states


_BOOLEAN: Mapping[str, Callable[[Context, Filter, StateSet, StateSet], FilterResult[StateSet]]] = {
    "state": _state_bool,
    "first": _first_bool,
    "forall": _forall,
    "exists": _one_bool,
    "print": _print_bool,
    "printall": _print_bool,
}

_NUMERIC: Mapping[str, Callable[[Context, Filter, Values, StateSet], Numeric]] = {
    "state": _state,
    "first": _first,
    "min": _minimum,
    "max": _maximum,
    "sum": _sum,
    "avg": _average,
    "range": _range,
    "print": _print,
    "printall": _print,
}
