"""Evaluation of an expression on many states at once, with numpy.

Columns may have any shapes that broadcast together. On an open mesh (one axis per variable) each
subexpression is evaluated only over the domain of its own variables, so that a table of 2**20
valuations takes few operations of full size.

The scalar evaluator raises an error if an expression has no value (a remainder by zero, a negative
exponent of an integer power, an integer beyond 64 bits). This evaluator marks such lanes as faults
instead, because a table contains valuations that no state has. The caller reports a fault if a
reachable state has it. NaN is not a fault: it is the value of 0/0.
"""

from __future__ import annotations

import operator as op
from collections.abc import Callable, Mapping
from functools import partial, reduce
from typing import Any, NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.explore.register_machine import Op, apply_to_doubles
from symcheck.semantics.expressions.evaluate import INT_MAX, INT_MIN, is_int64
from symcheck.semantics.expressions.literals import to_float
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Name,
    StateOperator,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator, connect

__all__ = ["BINARY", "FUNCTIONS", "Column", "Lanes", "evaluate_columns"]

Column = NDArray[Any]
"""Values of one expression in many states: bool, int64 or float64 by its type."""
Bools = NDArray[np.bool_]
Operation = Callable[..., "Lanes"]
_BITS = 63
"""The largest exponent for which a power of an int other than -1, 0 and 1 can have a value."""


class Lanes(NamedTuple):
    """The values of an expression in each lane.

    Attributes:
        values: bool, int64 or float64 by the type of the expression; arbitrary in faulty lanes.
        faults: bool, lanes in which the expression has no value; None: there are none.
            Both arrays broadcast to the shape of the columns.
    """

    values: Column
    faults: Bools | None = None

    def numbers(self) -> NDArray[np.float64]:
        """The values as doubles, NaN at faults."""
        numbers = self.values.astype(np.float64)
        return numbers if self.faults is None else np.where(self.faults, np.nan, numbers)

    def spread(self, shape: tuple[int, ...]) -> Lanes:
        """The lanes broadcast to a shape, as vectors."""
        values, faults = (
            None if a is None else np.broadcast_to(a, shape).reshape(-1) for a in self
        )
        assert values is not None
        return Lanes(values, faults)


def evaluate_columns(expression: Expression, columns: Mapping[str, Column]) -> Lanes:
    """The value of `expression` for each lane of the columns.

    Args:
        expression: a well-typed expression without labels and temporal operators.
        columns: a bool or int64 array for each variable that occurs.

    Returns:
        Lanes in the common shape of the columns that occur (0-dimensional for a constant).

    Raises:
        KeyError: a variable has no column.
        TypeError: a node is not arithmetic.
    """
    with np.errstate(all="ignore"):
        return _evaluate(expression, columns)


def _evaluate(expression: Expression, columns: Mapping[str, Column]) -> Lanes:
    match expression:
        case Literal(value, Type.DOUBLE):
            return Lanes(np.asarray(to_float(value)))
        case Literal(value, _):
            return (
                Lanes(np.asarray(value))
                if is_int64(value)
                else Lanes(np.asarray(0), np.asarray(True))
            )
        case Name(name):
            return Lanes(columns[name])
        case Unary(UnaryOperator.NOT, operand):
            values, faults = _evaluate(operand, columns)
            return Lanes(np.asarray(~values), faults)
        case Unary(_, operand):
            return _apply(_negative, _evaluate(operand, columns))
        case Binary(operator, left, right) if operator.is_logical:
            return _logical(operator, _evaluate(left, columns), _evaluate(right, columns))
        case Binary(operator, left, right):
            return _apply(BINARY[operator], _evaluate(left, columns), _evaluate(right, columns))
        case Conditional(condition, then, otherwise):
            chosen, a, b = (_evaluate(e, columns) for e in (condition, then, otherwise))
            faults = _union(
                chosen.faults,
                None if a.faults is None else chosen.values & a.faults,
                None if b.faults is None else ~chosen.values & b.faults,
            )
            return Lanes(np.where(chosen.values, a.values, b.values), faults)
        case Call(function, arguments):
            return _apply(FUNCTIONS[function], *(_evaluate(a, columns) for a in arguments))
        case LabelReference() | StateOperator():
            raise TypeError(f"not an arithmetic expression: {type(expression).__name__}")
        case _:
            assert_never(expression)


def _apply(operation: Callable[..., Lanes], *operands: Lanes) -> Lanes:
    """Apply an operation to values; a lane is faulty if the operation or an operand is."""
    values, faults = operation(*(o.values for o in operands))
    return Lanes(values, _union(faults, *(o.faults for o in operands)))


def _union(*faults: Bools | None) -> Bools | None:
    """The lanes that are faulty in one of the arrays; None if there are none."""
    present = [f for f in faults if f is not None and f.any()]
    return reduce(op.or_, present) if present else None


def _logical(operator: Operator, left: Lanes, right: Lanes) -> Lanes:
    """Apply a logical operator; faults of the right operand do not count where the left decides."""
    values = np.asarray(connect(operator, left.values, right.values))
    faults = right.faults
    if faults is not None and operator.decided(True) is not None:
        faults = faults & ~left.values
    if faults is not None and operator.decided(False) is not None:
        faults = faults & left.values
    return Lanes(values, _union(left.faults, faults))


def _are_integers(*values: Column) -> bool:
    return all(v.dtype.kind == "i" for v in values)


def _extremes(values: Column) -> tuple[int, ...]:
    return (int(values.min()), int(values.max())) if values.size else ()


def _checked(values: Column) -> Lanes:
    """Python integers as int64; those beyond 64 bits are faults."""
    faults = np.asarray((values < INT_MIN) | (values > INT_MAX), np.bool_)
    return Lanes(np.where(faults, 0, values).astype(np.int64), _union(faults))


def _arithmetic(operation: Callable[[Any, Any], Any]) -> Callable[[Column, Column], Lanes]:
    """`+`, `-` or `*` of columns or of ints.

    The results at the extreme operands show whether an int result may exceed 64 bits.
    """

    def apply(x: Column, y: Column) -> Lanes:
        if not _are_integers(x, y):
            return Lanes(np.asarray(operation(x, y)))
        corners = [operation(a, b) for a in _extremes(x) for b in _extremes(y)]
        if all(INT_MIN <= c <= INT_MAX for c in corners):
            return Lanes(np.asarray(operation(x, y)))
        return _checked(np.asarray(operation(x.astype(object), y.astype(object)), object))

    return apply


_add = _arithmetic(op.add)
_subtract = _arithmetic(op.sub)


def _negative(x: Column) -> Lanes:
    return _subtract(np.asarray(0), x) if _are_integers(x) else Lanes(np.asarray(-x))


def _power(base: Column, exponent: Column) -> Lanes:
    if not _are_integers(base, exponent):
        return _compiled(Op.POWD, base, exponent)
    faults = (exponent < 0) | ((exponent > _BITS) & ((base > 1) | (base < -1)))
    # The powers of -1, 0 and 1 depend on whether the exponent is 0 and whether it is odd.
    exponent = np.where(faults, 0, np.where(exponent > _BITS, _BITS - 1 + exponent % 2, exponent))
    largest = max(map(abs, _extremes(base)), default=0)
    if largest < 2 or largest ** max(_extremes(exponent), default=0) <= INT_MAX:
        return Lanes(np.asarray(np.power(base, exponent)), faults)
    values, beyond = _checked(np.asarray(base.astype(object) ** exponent.astype(object), object))
    return Lanes(values, _union(faults, beyond))


def _modulo(dividend: Column, divisor: Column) -> Lanes:
    zero = divisor == 0
    remainder = np.fmod(dividend, np.where(zero | (divisor == -1), 1, divisor))
    values, beyond = _add(remainder, np.where(remainder < 0, divisor, 0))
    return Lanes(values, _union(zero, beyond))


def _compiled(op: Op, x: Column, y: Column) -> Lanes:
    """An operation of the register machine on doubles.

    The powers and logarithms of numpy differ from those of the machine in their last digit.
    """
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    return Lanes(apply_to_doubles(op, x.ravel(), y.ravel()).reshape(x.shape))


def _extreme(operation: Callable[[Column, Column], Column], *, least: bool) -> Operation:
    """`min` or `max`; zeros are equal to numpy whatever their signs."""

    def better(x: Column, y: Column) -> Column:
        if _are_integers(x, y):
            return operation(x, y)
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
        zero = np.where(np.signbit(x) == least, x, y)
        return np.where(x == y, zero, operation(x, y))

    return _total(better)


def _rounding(function: Callable[[Column], Column]) -> Operation:
    def round_all(x: Column) -> Lanes:
        if _are_integers(x):
            return Lanes(x)
        values = np.asarray(function(x))
        faults = ~((values >= float(INT_MIN)) & (values < -float(INT_MIN)))
        return Lanes(np.where(faults, 0, values).astype(np.int64), faults)

    return round_all


def _nearest(x: Column) -> Column:
    """The nearest ints, upwards from the middle; x + 0.5 would be rounded."""
    whole = np.floor(x)
    return np.asarray(whole + (x - whole >= 0.5))


def _total(operation: Callable[..., Column]) -> Operation:
    """A total operation; more than two operands are combined from the left."""
    return lambda *operands: Lanes(np.asarray(reduce(operation, operands)))


BINARY: Mapping[Operator, Callable[[Column, Column], Lanes]] = {
    Operator.PLUS: _add,
    Operator.MINUS: _subtract,
    Operator.TIMES: _arithmetic(op.mul),
    Operator.DIVIDE: _total(np.true_divide),
    Operator.POWER: _power,
    Operator.EQ: _total(op.eq),
    Operator.NE: _total(op.ne),
    Operator.LT: _total(op.lt),
    Operator.LE: _total(op.le),
    Operator.GT: _total(op.gt),
    Operator.GE: _total(op.ge),
}

FUNCTIONS: Mapping[Function, Operation] = {
    Function.MIN: _extreme(np.minimum, least=True),
    Function.MAX: _extreme(np.maximum, least=False),
    Function.FLOOR: _rounding(np.floor),
    Function.CEIL: _rounding(np.ceil),
    Function.ROUND: _rounding(_nearest),
    Function.POW: _power,
    Function.MOD: _modulo,
    Function.LOG: partial(_compiled, Op.LOGD),
}
