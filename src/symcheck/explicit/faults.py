"""Faults that compiled code found, raised as the interpreter describes them.

Compiled code only knows where it stopped. The interpreter is run there again, and its error names
the command, the values and what was expected.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NoReturn

from symcheck.errors import Diagnostic, InputError, ModelFault
from symcheck.semantics import interpreter
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.state_faults import at_state, describe_state
from symcheck.syntax.ast import Expression, Type

__all__ = ["raise_expression_fault", "raise_model_fault"]


def raise_expression_fault(
    expression: Expression, variables: tuple[Variable, ...], values: Mapping[int, int], status: int
) -> NoReturn:
    """Raise the ModelFault of an expression that has no value.

    Args:
        expression: the expression.
        variables: the variables of the model.
        values: variable index to value, with those of all variables that the expression reads.
        status: of the register machine, for the message of an internal error.
    """
    read = [variables[i] for i in values]
    named = {
        v.name: bool(x) if v.type is Type.BOOL else x
        for v, x in zip(read, values.values(), strict=True)
    }
    try:
        evaluate(expression, named)
    except InputError as fault:
        raise at_state(fault, describe_state(read, list(values.values()))) from None
    raise AssertionError(
        f"the register machine stopped with status {status}, "
        f"but the interpreter finds a value: {expression}"
    )


def raise_model_fault(
    model: BoundModel, state: interpreter.State, status: int, *, check_sums: bool = True
) -> NoReturn:
    """Raise the ModelFault of a state in which the model breaks a rule."""
    interpreter.choices(model, state, check_sums=check_sums)
    shown = describe_state(model.variables, state)
    unbounded = ", ".join(v.name for v in model.variables if v.low is None)
    if not unbounded:
        raise AssertionError(
            f"successor generation stopped with status {status} in {shown}, "
            "but the interpreter finds no fault"
        )
    raise ModelFault(
        Diagnostic(
            f"a variable without bounds ({unbounded}) leaves 32 bits, after the state {shown}",
            code="unbounded",
            hint="give it a range, or a guard that stops it",
        )
    )
