"""State formulas without probabilistic operators, compiled to predicates on arrays of packed
states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import assert_never

import numpy as np

from symcheck.errors import Diagnostic, NameFault, UnsupportedError
from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import Rows, StateLayout
from symcheck.matrices.rows import Bools
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Name,
    StateOperator,
    Unary,
)
from symcheck.syntax.operators import Operator, UnaryOperator, connect
from symcheck.syntax.traversal import nodes

__all__ = ["StatePredicate", "compile_predicate"]

StatePredicate = Callable[[Rows, Bools], Bools]
"""Packed states (uint64[n, words]) and which of them are deadlocks (bool[n]) to bool[n]."""


def compile_predicate(
    formula: Expression, model: BoundModel, layout: StateLayout, labels: Mapping[str, Expression]
) -> StatePredicate:
    """Compile a state formula.

    Args:
        formula: the formula.
        model: the model.
        layout: how the states are packed.
        labels: label names and their state formulas.

    Raises:
        NameFault: an unknown label.
        UnsupportedError: a probabilistic, reward or path operator inside the formula.
    """
    match formula:
        case LabelReference("deadlock"):
            return lambda _, deadlocks: deadlocks
        case LabelReference("init"):
            return _initial(model, layout)
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
            return compile_predicate(labels[name], model, layout, labels)
        case Unary(UnaryOperator.NOT, operand):
            inner = compile_predicate(operand, model, layout, labels)
            return lambda rows, deadlocks: ~inner(rows, deadlocks)
        case Binary(operator, left, right) if operator.is_logical:
            return _connect(
                operator,
                compile_predicate(left, model, layout, labels),
                compile_predicate(right, model, layout, labels),
            )
        case Literal() | Name() | Unary() | Binary() | Conditional() | Call() | StateOperator():
            return _compile_expression(formula, model, layout)
        case _:
            assert_never(formula)


def _compile_expression(
    formula: Expression, model: BoundModel, layout: StateLayout
) -> StatePredicate:
    for node in nodes(formula):
        if isinstance(node, StateOperator):
            raise UnsupportedError(
                "sampling does not estimate nested operators (paths would have to be sampled from "
                "every state of a path); without sampling the property is checked numerically"
            )
        if isinstance(node, LabelReference):
            raise UnsupportedError(
                f'sampling reads the label "{node.name}" only under ! & | => <=>; without '
                "sampling it may stand anywhere"
            )
    code = compile_expression(formula, model)
    return lambda rows, _: np.asarray(code.run_packed(layout, rows), np.bool_)


def _connect(operator: Operator, left: StatePredicate, right: StatePredicate) -> StatePredicate:
    return lambda rows, deadlocks: connect(operator, left(rows, deadlocks), right(rows, deadlocks))


def _initial(model: BoundModel, layout: StateLayout) -> StatePredicate:
    if model.initial is not None:
        return _compile_expression(model.initial, model, layout)
    state = layout.pack([np.array([int(v.initial or 0)], np.int64) for v in model.variables])
    return lambda rows, _: np.asarray((rows == state).all(axis=1))
