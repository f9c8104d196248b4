"""Filters: one value from the values of a formula in many states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from symcheck.check.context import Context
from symcheck.check.result import Line
from symcheck.engines.base import StateSet, Values
from symcheck.errors import Diagnostic, InputError
from symcheck.syntax.ast import Filter, Type

__all__ = ["FilterResult", "apply_filter", "lines"]

Formula = StateSet | Values


@dataclass(frozen=True)
class FilterResult:
    """The result of a filter.

    Attributes:
        value: bounds (lower, upper), a bool, or two pairs of bounds (range); None if the filter has
            no single value.
        per_state: the value in each state, for a filter within a larger formula.
        rounded: whether `value` was computed in floating-point arithmetic.
    """

    value: bool | tuple[float, float] | tuple[tuple[float, float], tuple[float, float]] | None
    per_state: Formula
    rounded: bool = False


def apply_filter(
    context: Context, node: Filter, formula: Formula, states: StateSet, type: Type
) -> FilterResult:
    """Apply a filter to the values of its formula.

    Args:
        context: the engine, and the log for printed lines.
        node: the filter.
        formula: a set of states for a bool, values for a number.
        states: the states that the filter selects.
        type: of the formula.

    Raises:
        InputError: no state is selected, or several for 'state', or the formula has a wrong type.
    """
    if not states:
        raise InputError(
            Diagnostic("no state satisfies the condition of this filter", node.span, "filter-empty")
        )
    if type is Type.BOOL:
        found = _BOOLEAN.get(node.operator)
        if found is not None:
            return found(context, node, formula, states)  # type: ignore[arg-type]
    else:
        numeric = _NUMERIC.get(node.operator)
        if numeric is not None:
            return numeric(context, node, formula, states)  # type: ignore[arg-type]
    kind = "bool" if type is Type.BOOL else "number"
    raise InputError(
        Diagnostic(f"the filter '{node.operator}' does not take a {kind}", node.span, "filter-type")
    )


def _truth(context: Context, value: bool) -> FilterResult:
    return FilterResult(value, context.engine.all if value else context.engine.none)


def _number(context: Context, bounds: tuple[float, float], rounded: bool) -> FilterResult:
    return FilterResult(bounds, context.engine.constant(*bounds, rounded=rounded), rounded)


def _one_bool(context: Context, _: Filter, formula: StateSet, states: StateSet) -> FilterResult:
    return _truth(context, bool(formula & states))


def _state_bool(
    context: Context, node: Filter, formula: StateSet, states: StateSet
) -> FilterResult:
    return _one_bool(context, node, formula, _single(node, states))


def _first_bool(
    context: Context, node: Filter, formula: StateSet, states: StateSet
) -> FilterResult:
    return _one_bool(context, node, formula, context.engine.first(states))


def _forall(context: Context, _: Filter, formula: StateSet, states: StateSet) -> FilterResult:
    return _truth(context, states <= formula)


def _count(context: Context, _: Filter, formula: StateSet, states: StateSet) -> FilterResult:
    count = (formula & states).count
    return _number(context, (count, count), rounded=False)


def _print_bool(
    context: Context, node: Filter, formula: StateSet, states: StateSet
) -> FilterResult:
    wanted = states if node.operator == "printall" else states & formula
    context.log.lines.extend(lines(context, formula, wanted, Type.BOOL))
    return FilterResult(None, formula)


def _state(context: Context, node: Filter, formula: Values, states: StateSet) -> FilterResult:
    return _number(context, formula.minimum(_single(node, states)), formula.rounded(states))


def _first(context: Context, _: Filter, formula: Values, states: StateSet) -> FilterResult:
    first = context.engine.first(states)
    return _number(context, formula.minimum(first), formula.rounded(first))


def _minimum(context: Context, _: Filter, formula: Values, states: StateSet) -> FilterResult:
    return _number(context, formula.minimum(states), formula.rounded(states))


def _maximum(context: Context, _: Filter, formula: Values, states: StateSet) -> FilterResult:
    return _number(context, formula.maximum(states), formula.rounded(states))


def _sum(context: Context, _: Filter, formula: Values, states: StateSet) -> FilterResult:
    return _number(context, formula.total(states), formula.rounded(states))


def _average(context: Context, _: Filter, formula: Values, states: StateSet) -> FilterResult:
    low, high = formula.total(states)
    return _number(context, (low / states.count, high / states.count), formula.rounded(states))


def _range(_: Context, __: Filter, formula: Values, states: StateSet) -> FilterResult:
    return FilterResult(
        (formula.minimum(states), formula.maximum(states)), formula, formula.rounded(states)
    )


def _arguments(context: Context, node: Filter, formula: Values, states: StateSet) -> FilterResult:
    """The states whose value may be the least (greatest), given its accuracy."""
    if node.operator == "argmin":
        sure, maybe = formula.compare("<=", formula.minimum(states)[1])
    else:
        sure, maybe = formula.compare(">=", formula.maximum(states)[0])
    found = (sure | maybe) & states
    context.log.lines.extend(lines(context, formula, found, Type.DOUBLE))
    return FilterResult(None, found)


def _print(context: Context, node: Filter, formula: Values, states: StateSet) -> FilterResult:
    wanted = states if node.operator == "printall" else states & formula.compare("!=", 0)[0]
    context.log.lines.extend(lines(context, formula, wanted, Type.DOUBLE))
    return FilterResult(None, formula)


def lines(context: Context, formula: Formula, states: StateSet, type: Type) -> list[Line]:
    """The value of a formula in each of the states, in the order of indices."""
    engine = context.engine
    numbers = np.flatnonzero(engine.to_bools(states)).tolist()
    if type is Type.BOOL:
        values: list[bool | float] = [bool(v) for v in engine.indicator(formula).at(states)[0]]
    else:
        low, high = formula.at(states)  # type: ignore[union-attr]
        values = [_middle(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
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


_BOOLEAN: Mapping[str, Callable[[Context, Filter, StateSet, StateSet], FilterResult]] = {
    "state": _state_bool,
    "first": _first_bool,
    "forall": _forall,
    "exists": _one_bool,
    "count": _count,
    "print": _print_bool,
    "printall": _print_bool,
}

_NUMERIC: Mapping[str, Callable[[Context, Filter, Values, StateSet], FilterResult]] = {
    "state": _state,
    "first": _first,
    "min": _minimum,
    "max": _maximum,
    "sum": _sum,
    "avg": _average,
    "range": _range,
    "argmin": _arguments,
    "argmax": _arguments,
    "print": _print,
    "printall": _print,
}
