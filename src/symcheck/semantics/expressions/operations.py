"""The meanings of operators and functions as instructions on ints and on doubles.

All who compute many values at once share them: numpy columns execute the instructions
(`vectorised.py`), compiled code holds them (`symcheck.explicit.code_generation`), bounds on errors
have a formula for each (`running_errors.py`), and so have the values of properties
(`symcheck.engines.explicit.array_values`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import partial, reduce
from typing import Any, TypeVar

from symcheck.kernels.explore.register_machine import Op
from symcheck.syntax.operators import Function, Operator, Signature, complete

__all__ = ["DECISIONS", "ROUNDINGS", "Instruction", "compose", "is_on_doubles"]

R = TypeVar("R")


class Instruction(Enum):
    """A calculation with two numbers.

    ints, doubles: the instructions of the register machine; None: it has no such operands.
    """

    ADD = Op.ADDI, Op.ADDD
    SUBTRACT = Op.SUBI, Op.SUBD
    MULTIPLY = Op.MULI, Op.MULD
    DIVIDE = None, Op.DIVD
    POWER = Op.POWI, Op.POWD
    REMAINDER = Op.MODI, None
    LOGARITHM = None, Op.LOGD
    MINIMUM = Op.MINI, Op.MIND
    MAXIMUM = Op.MAXI, Op.MAXD

    def __init__(self, ints: Op | None, doubles: Op | None) -> None:
        self.ints, self.doubles = ints, doubles


def _folded(instruction: Instruction) -> Callable[..., Any]:
    """One instruction, for more than two operands from the left."""
    return lambda apply, *operands: reduce(partial(apply, instruction), operands)


_COMPOSITIONS: Mapping[Operator | Function, Callable[..., Any]] = complete(
    {
        Operator.PLUS: _folded(Instruction.ADD),
        Operator.MINUS: _folded(Instruction.SUBTRACT),
        Operator.TIMES: _folded(Instruction.MULTIPLY),
        Operator.DIVIDE: _folded(Instruction.DIVIDE),
        Operator.POWER: _folded(Instruction.POWER),
        Function.MIN: _folded(Instruction.MINIMUM),
        Function.MAX: _folded(Instruction.MAXIMUM),
        Function.POW: _folded(Instruction.POWER),
        Function.MOD: _folded(Instruction.REMAINDER),
        Function.LOG: _folded(Instruction.LOGARITHM),
    },
    [
        *(o for o in Operator if not o.is_boolean),
        *(f for f in Function if f.signature is not Signature.ROUNDING),
    ],
)
"""Given how to apply an instruction to two operands, and the operands."""


def compose(
    operation: Operator | Function,
    apply: Callable[[Instruction, R, R], R],
    operands: Sequence[R],
) -> R:
    """An operator or function whose value is a number and no rounding, by instructions.

    Args:
        operation: the operator or function.
        apply: executes an instruction on two operands, or writes code for it.
        operands: all ints, or all doubles (see `is_on_doubles`).
    """
    result: R = _COMPOSITIONS[operation](apply, *operands)
    return result


def is_on_doubles(operation: Operator | Function, are_doubles: Sequence[bool]) -> bool:
    """Whether an operation is one on doubles, given which of its operands are doubles."""
    return operation.signature is Signature.DIVISION or any(are_doubles)


ROUNDINGS: Mapping[Function, Op] = complete(
    {Function.FLOOR: Op.FLOOR, Function.CEIL: Op.CEIL, Function.ROUND: Op.ROUND},
    [f for f in Function if f.signature is Signature.ROUNDING],
)
"""The instruction on a double without error that gives an int."""

DECISIONS: Mapping[Operator | Function, Op] = complete(
    {
        Operator.EQ: Op.ZERO,
        Operator.NE: Op.NONZERO,
        Operator.LT: Op.NEGATIVE,
        Operator.GE: Op.NONNEGATIVE,
        Operator.GT: Op.POSITIVE,
        Operator.LE: Op.NONPOSITIVE,
        Function.FLOOR: Op.FLOORS,
        Function.CEIL: Op.CEILS,
        Function.ROUND: Op.ROUNDS,
    },
    [*(o for o in Operator if o.is_comparison), *ROUNDINGS],
)
"""The decision that gives the value of a comparison (on left - right) or of a rounding."""
