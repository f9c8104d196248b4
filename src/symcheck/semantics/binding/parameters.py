"""Parameters: constants of type double that are left open, and where they may stand."""

from __future__ import annotations

import operator as op
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from symcheck.errors import NO_SPAN, Diagnostic, ModelFault, NameFault, TypeFault, UnsupportedError
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Measure,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.declarations import Constant
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.traversal import Tree, names, nodes, operands, transform

__all__ = [
    "FIELD",
    "Ranges",
    "check_function",
    "check_places",
    "check_ranges",
    "no_function",
    "with_open_thresholds",
]

Ranges = Mapping[str, tuple[Fraction, Fraction]]
"""The range of each parameter, whose ends do not belong to it."""

FIELD: Mapping[object, Callable[[Any, Any], Any]] = {
    Operator.PLUS: op.add,
    Operator.MINUS: op.sub,
    Operator.TIMES: op.mul,
    Operator.DIVIDE: op.truediv,
}
"""The operators whose values are rational functions."""
_WHERE = (
    "only probabilities, rates and rewards depend on parameters, as rational functions; "
    "-const NAME=VALUE gives one a value"
)


def check_ranges(
    parameters: Ranges,
    declared: Iterable[Constant],
    given: Container[str],
    report: DiagnosticCollector,
) -> None:
    """Report parameters that are no open constants of type double, or have a value (`given`)."""
    known = {c.name: c for c in declared}
    for name in parameters:
        constant = known.get(name)
        if constant is None or constant.value is not None:
            why = "is defined in the text" if constant else "is not declared in the model"
            hint = suggest(name, known) or f"declare it there: const double {name};"
            span = constant.span if constant else NO_SPAN
            report.absorb(NameFault(Diagnostic(f"parameter {name} {why}", span, "parameter", hint)))
        elif constant.type is not Type.DOUBLE:
            message = f"{name} is of type {constant.type.value}: a parameter is a real number"
            hint = f"-const {name}=VALUE gives it a value"
            report.absorb(TypeFault(Diagnostic(message, constant.span, "parameter", hint)))
        elif name in given:
            message, hint = f"parameter {name} has a value, too", "give a range or a value"
            report.absorb(NameFault(Diagnostic(message, constant.span, "parameter", hint)))


def check_places(model: BoundModel) -> None:
    """Refuse parameters where graphs would depend on them, or values would be no functions.

    Raises:
        ModelFault: a parameter stands in a guard, an assignment, a condition or a label, or in an
            operation that gives no rational function.
        UnsupportedError: models of this type have no parameters.
    """
    if model.type.has_own_syntax:
        raise UnsupportedError(
            f"parameters are not available for {model.type.called}",
            hint="-const gives each a value",
        )

    def refuse(where: str, expression: Expression) -> None:
        _refuse(model.parameters, expression, f"in {where}")

    for command in (c for m in model.modules for c in m.commands):
        refuse("a guard", command.guard)
        for update in command.updates:
            check_function(model.parameters, update.probability)
            for _, value in update.assignments:
                refuse("an assignment", value)
    for item in (i for r in model.rewards for i in r.items):
        refuse("the guard of a reward", item.guard)
        check_function(model.parameters, item.value)
    for label in model.labels.values():
        refuse("a label", label)
    if model.initial is not None:
        refuse("the condition on initial states", model.initial)


def with_open_thresholds(formula: Expression, parameters: Ranges) -> Expression:
    """The formula with comparisons in place of bounds that depend on parameters: `P=? [...] >= p`.

    A bound without a direction must hold under all strategies.
    """

    def compared(node: Tree) -> Tree:
        if not isinstance(node, Measure) or node.bound is None:
            return node
        bound = node.bound
        if parameters.keys().isdisjoint(names(bound.threshold)):
            return node
        query = replace(node, bound=None)
        if node.direction is None:
            query = replace(query, direction="min" if bound.operator.is_lower_bound else "max")
        return Binary(bound.operator, query, bound.threshold, span=node.span)

    return transform(formula, compared) if parameters else formula


def no_function(expression: Expression, message: str) -> ModelFault:
    """The fault of a parameter that stands where values are no rational functions of it."""
    return ModelFault(Diagnostic(message, expression.span, "parameter", _WHERE))


def _refuse(parameters: Container[str], expression: Expression, where: str) -> None:
    for node in nodes(expression):
        if isinstance(node, Name) and node.name in parameters:
            raise no_function(node, f"parameter {node.name} stands {where}")


def check_function(parameters: Container[str], expression: Expression) -> None:
    """Refuse what is no rational function of the parameters in each state. Raises ModelFault."""
    match expression:
        case Binary(Operator.POWER, base, exponent) | Call(Function.POW, (base, exponent)):
            functions, numbers, where = [base], [exponent], "in an exponent"
        case Conditional(condition, then, otherwise):
            functions, numbers, where = [then, otherwise], [condition], "in a condition"
        case Unary() | Binary(Operator.PLUS | Operator.MINUS | Operator.TIMES | Operator.DIVIDE):
            functions, numbers, where = [*operands(expression)], [], ""
        case _:
            called = expression.function if isinstance(expression, Call) else "an operator"
            where = f"under {called!s}, which is no rational function"
            functions, numbers = [], [*operands(expression)]
    for part in functions:
        check_function(parameters, part)
    for part in numbers:
        _refuse(parameters, part, where)
