"""The state that a text names, such as "x=2, lost=true" or "x=2 & lost"."""

from __future__ import annotations

from collections.abc import Sequence

from symcheck.api.checking import CheckedModel
from symcheck.constant_values import listed_items
from symcheck.errors import UsageError
from symcheck.semantics.binding.bind import bind_expression
from symcheck.semantics.interpreter import State
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Binary, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import conjuncts

__all__ = ["chosen_state"]


def chosen_state(model: CheckedModel, text: str) -> State:
    """The state with some values, or the only one that satisfies a condition.

    A model is not built for a text that gives the value of each variable. Such a state need not be
    reachable, unless the model was read from files with its states.

    Raises:
        InputError: the text is faulty.
        UsageError: no state or several satisfy it, or a value is outside of its range.
    """
    parsed = [parse_expression(item.strip(), "state") for item in [*listed_items(text)] or [text]]
    if model.bound.builder is None:
        given = _valuation(model.bound, [part for c in parsed for part in conjuncts(c)])
        if given is not None:
            return given
    for condition in parsed:
        bind_expression(condition, model.bound)  # its faults are at the places of this text
    found = model.where(" & ".join(f"({pretty(condition)})" for condition in parsed))
    if not found:
        raise UsageError(f"no reachable state satisfies {text}")
    if found.count > 1:
        shown = " and ".join(map(repr, found[:2]))
        raise UsageError(
            f"{found.count:,} states satisfy {text}, such as {shown}",
            hint="a path starts in one of them: add values of other variables",
        )
    return found[0].valuation


def _valuation(model: BoundModel, conditions: Sequence[Expression]) -> State | None:
    """The state that conditions give; None unless each names the value of another variable."""
    values: dict[str, bool | int] = {}
    variables = {v.name: v for v in model.variables}
    for condition in conditions:
        match condition:
            case Name(name):
                named: Expression = Literal(True, Type.BOOL)
            case Unary(UnaryOperator.NOT, Name(name)):
                named = Literal(False, Type.BOOL)
            case Binary(Operator.EQ, Name(name), named):
                pass
            case _:
                return None
        if name not in variables or name in values:
            return None
        variable, bound = variables[name], bind_expression(named, model)[0]
        if not isinstance(bound, Literal) or bound.type is not variable.type:
            return None
        value = int(bound.value) if variable.type is Type.INT else bool(bound.value)
        if variable.domain is not None and value not in variable.domain:
            ends = f"{variable.low} to {variable.high}"
            raise UsageError(f"{name}={value} is outside of the range of {name}, {ends}")
        values[name] = value
    return tuple(values[name] for name in variables) if len(values) == len(variables) else None
