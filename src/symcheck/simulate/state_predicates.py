"""State formulas without operators, evaluated on many states at once: what a sampled path is asked in each state."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from symcheck.errors import Diagnostic, NameFault, UnsupportedError
from symcheck.explicit.compile import compile_expression
from symcheck.matrices.rows import Bools, Int64s
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import (
    Binary,
    Expression,
    Filter,
    LabelReference,
    MultiObjective,
    PathQuantifier,
    ProbabilityOperator,
    RewardOperator,
    StateFilter,
    SteadyState,
    Unary,
)
from symcheck.syntax.traversal import nodes

__all__ = ["Atom", "atom", "both", "negation"]

_OPERATORS = (
    ProbabilityOperator,
    RewardOperator,
    SteadyState,
    PathQuantifier,
    Filter,
    StateFilter,
    MultiObjective,
)

Atom = Callable[[Int64s, Bools], Bools]
"""Columns of states (int64[variables, n]) and which of them are deadlocks (bool[n]), to bool[n]."""


def negation(formula: Expression) -> Expression:
    """Not the formula."""
    return Unary("!", formula)


def both(left: Expression, right: Expression) -> Expression:
    """The conjunction."""
    return Binary("&", left, right)


def atom(formula: Expression, model: BoundModel, labels: Mapping[str, Expression]) -> Atom:
    """Compile a state formula. Raises NameFault for an unknown label, UnsupportedError for a nested operator."""
    match formula:
        case LabelReference("deadlock"):
            return lambda _, deadlock: deadlock
        case LabelReference("init"):
            return _initial(model)
        case LabelReference(name):
            if name not in labels:
                known = ", ".join(f'"{k}"' for k in [*labels, "init", "deadlock"])
                raise NameFault(
                    Diagnostic(
                        f'unknown label "{name}"',
                        formula.span,
                        "unknown-label",
                        f"known are {known}",
                    )
                )
            return atom(labels[name], model, labels)
        case Unary("!", operand):
            inner = atom(operand, model, labels)
            return lambda columns, deadlock: ~inner(columns, deadlock)
        case Binary("&" | "|" | "=>" | "<=>" as operator, left, right):
            return _binary(operator, atom(left, model, labels), atom(right, model, labels))
        case _:
            return _plain(formula, model)


def _plain(formula: Expression, model: BoundModel) -> Atom:
    for node in nodes(formula):
        if isinstance(node, _OPERATORS):
            raise UnsupportedError(
                "-sim does not estimate an operator inside another one (paths would have to be sampled from every state on "
                "the way); without -sim the property is checked numerically"
            )
        if isinstance(node, LabelReference):
            raise UnsupportedError(
                f'-sim reads the label "{node.name}" only under ! & | => <=>; without -sim it may stand anywhere'
            )
    code = compile_expression(formula, model)
    support = list(code.support)
    return lambda columns, _: np.asarray(code.run(columns[support]), np.bool_)


def _binary(operator: str, left: Atom, right: Atom) -> Atom:
    match operator:
        case "&":
            return lambda c, d: left(c, d) & right(c, d)
        case "|":
            return lambda c, d: left(c, d) | right(c, d)
        case "=>":
            return lambda c, d: ~left(c, d) | right(c, d)
        case _:
            return lambda c, d: np.asarray(left(c, d) == right(c, d))


def _initial(model: BoundModel) -> Atom:
    if model.initial is None:
        values = np.array([int(v.initial or 0) for v in model.variables], np.int64).reshape(-1, 1)
        return lambda columns, _: np.asarray((columns == values).all(axis=0))
    return _plain(model.initial, model)
