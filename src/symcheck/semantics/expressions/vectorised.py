"""Evaluation of an expression on many states at once, with numpy.

Columns may have any shapes that broadcast together. On an open mesh (one axis per variable) each
subexpression is evaluated only over the domain of its own variables, so that a table of 2**20
valuations takes few operations of full size.

The scalar evaluator raises an error if an expression has no value (a remainder by zero, a negative
exponent of an integer power, an integer beyond 64 bits). This evaluator marks such lanes as faults
instead, because a table contains valuations that no state has. The caller reports a fault if a
reachable state has it. NaN is not a fault: it is the value of 0/0.

Doubles carry bounds on their rounding errors (`running_errors.py`). Lanes in which these do not
decide a comparison or a rounding to an int are left to the scalar evaluator.
"""

from __future__ import annotations

import operator as op
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from math import prod
from typing import Any, NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import ModelFault
from symcheck.kernels.explore.register_machine import Op, apply_to_doubles, decide_doubles
from symcheck.semantics.expressions.evaluate import (
    INT_MAX,
    INT_MIN,
    KEPT_ERROR,
    evaluate,
    is_int64,
)
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, to_signed_float
from symcheck.semantics.expressions.operations import (
    DECISIONS,
    Instruction,
    compose,
    is_on_doubles,
)
from symcheck.semantics.expressions.running_errors import (
    Enclosed,
    RunningErrors,
    literal_error,
)
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
from symcheck.syntax.operators import (
    Function,
    Operator,
    Signature,
    UnaryOperator,
    complete,
    connect,
)
from symcheck.syntax.traversal import names

__all__ = ["Column", "Lanes", "evaluate_columns", "open_mesh"]

Column = NDArray[Any]
"""Values of one expression in many states: bool, int64 or float64 by its type."""
Bools = NDArray[np.bool_]
_BITS = 63
"""The largest exponent for which a power of an int other than -1, 0 and 1 can have a value."""


class Lanes(NamedTuple):
    """The values of an expression in each lane.

    Attributes:
        values: bool, int64 or float64 by the type of the expression; arbitrary in faulty lanes.
        faults: bool, lanes in which the expression has no value; None: there are none.
            The arrays broadcast to the shape of the columns.
        errors: float64, bounds on the errors of doubles; None: there are none.
    """

    values: Column
    faults: Bools | None = None
    errors: Column | None = None

    def numbers(self) -> NDArray[np.float64]:
        """The values as doubles, NaN at faults."""
        numbers = self.values.astype(np.float64)
        return numbers if self.faults is None else np.where(self.faults, np.nan, numbers)

    def spread(self, shape: tuple[int, ...]) -> Lanes:
        """The lanes broadcast to a shape, as vectors."""
        values, faults, errors = (
            None if a is None else np.broadcast_to(a, shape).reshape(-1) for a in self
        )
        assert values is not None
        return Lanes(values, faults, errors)


def open_mesh(
    domains: Mapping[str, Sequence[bool | int] | None], most: float
) -> tuple[dict[str, Column], tuple[int, ...]] | None:
    """All valuations of variables, as columns with one axis per variable, and the shape of these
    together; None if they are more than `most`, which infinitely many are.

    Args:
        domains: the values of each variable; None: it has no bounds.
        most: the most valuations.
    """
    shape = []
    for domain in domains.values():
        if domain is None:
            return None
        shape.append(len(domain))
    if prod(shape) > most:
        return None
    mesh = np.meshgrid(*map(np.asarray, domains.values()), indexing="ij", sparse=True)
    return dict(zip(domains, mesh, strict=True)), tuple(shape)


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
        return _accurate(expression, columns, _evaluate(expression, columns))


def _accurate(expression: Expression, columns: Mapping[str, Column], lanes: Lanes) -> Lanes:
    """Replace doubles that have lost digits by the ones nearest to the exact values."""
    if lanes.errors is None:
        return lanes
    unsure = np.asarray(_decide(Op.NUMBER, lanes.values, lanes.errors)[1])
    return _ask(expression, columns, lanes, unsure)


def _decide(op: Op, values: Column, errors: Column) -> tuple[Column, Bools]:
    """The answers of a decision of the register machine, and where it does not decide."""
    values, errors = np.broadcast_arrays(
        np.asarray(values, np.float64), np.asarray(errors, np.float64)
    )
    answers, unsure = decide_doubles(op, values.ravel(), errors.ravel())
    return answers.reshape(values.shape), unsure.reshape(values.shape)


def _ask(
    expression: Expression, columns: Mapping[str, Column], lanes: Lanes, unsure: Bools
) -> Lanes:
    """Let the scalar evaluator decide the lanes that are unsure and not faulty."""
    values, faults, errors = lanes
    if faults is not None:
        unsure = unsure & ~faults
    if not unsure.any():
        return lanes
    used = names(expression)
    read = [(n, columns[n]) for n in columns if n in used]
    shape = np.broadcast_shapes(unsure.shape, values.shape, *(c.shape for _, c in read))
    at = np.flatnonzero(np.broadcast_to(unsure, shape))
    values = np.broadcast_to(values, shape).ravel().copy()
    bad = np.zeros(values.shape, np.bool_)
    bad |= False if faults is None else np.broadcast_to(faults, shape).ravel()
    known: dict[tuple[Any, ...], Any] = {}
    rows = [np.broadcast_to(c, shape).ravel()[at].tolist() for _, c in read]
    valuations = zip(*rows, strict=True) if rows else ((),) * len(at)
    for i, valuation in zip(at.tolist(), valuations, strict=True):
        if valuation not in known:
            try:
                names_of = (n for n, _ in read)
                known[valuation] = evaluate(expression, dict(zip(names_of, valuation, strict=True)))
            except ModelFault:
                known[valuation] = None
        answer = known[valuation]
        bad[i] |= answer is None
        values[i] = values[i] if answer is None else answer
    if errors is not None:
        errors = np.broadcast_to(errors, shape).ravel().copy()
        size = np.abs(values[at])
        errors[at] = np.maximum(np.spacing(size), 2 * KEPT_ERROR * size)
        errors = errors.reshape(shape)
    return Lanes(values.reshape(shape), _union(bad.reshape(shape)), errors)


def _evaluate(expression: Expression, columns: Mapping[str, Column]) -> Lanes:
    match expression:
        case Literal(value, Type.DOUBLE):
            return Lanes(np.asarray(to_signed_float(value)), None, _bound(literal_error(value)))
        case Literal(value, _):
            return (
                Lanes(np.asarray(value))
                if is_int64(value)
                else Lanes(np.asarray(0), np.asarray(True))
            )
        case Name(name):
            return Lanes(columns[name])
        case Unary(UnaryOperator.NOT, operand):
            lanes = _evaluate(operand, columns)
            return Lanes(np.asarray(~lanes.values), lanes.faults)
        case Unary(_, operand):
            lanes = _evaluate(operand, columns)
            if lanes.values.dtype.kind == "f":
                return Lanes(np.asarray(-lanes.values), lanes.faults, lanes.errors)
            negative = _subtract(np.asarray(0), lanes.values)
            return Lanes(negative.values, _union(negative.faults, lanes.faults))
        case Binary(operator, left, right) if operator.is_logical:
            return _logical(operator, _evaluate(left, columns), _evaluate(right, columns))
        case Binary(operator, left, right):
            operands = _evaluate(left, columns), _evaluate(right, columns)
            if not operator.is_comparison:
                return _apply(operator, *operands)
            faults = _union(*(o.faults for o in operands))
            if all(o.values.dtype.kind != "f" for o in operands):
                return Lanes(np.asarray(operator.compare(*(o.values for o in operands))), faults)
            difference = _ERRORS.difference(*map(_enclosed, operands))
            return _decided(operator, expression, columns, difference, faults)
        case Conditional(condition, then, otherwise):
            chosen, a, b = (_evaluate(e, columns) for e in (condition, then, otherwise))
            faults = _union(
                chosen.faults,
                None if a.faults is None else chosen.values & a.faults,
                None if b.faults is None else ~chosen.values & b.faults,
            )
            if "f" not in (a.values.dtype.kind, b.values.dtype.kind):
                return Lanes(np.where(chosen.values, a.values, b.values), faults)
            x, y = _enclosed(a), _enclosed(b)
            errors = None
            if x.error is not None or y.error is not None:
                bounds = (np.asarray(0.0) if e is None else e for e in (x.error, y.error))
                errors = np.where(chosen.values, *bounds)
            return Lanes(np.where(chosen.values, x.value, y.value), faults, errors)
        case Call(function, (argument,)) if function.signature is Signature.ROUNDING:
            lanes = _evaluate(argument, columns)
            if lanes.values.dtype.kind != "f":
                return lanes
            return _decided(function, expression, columns, _enclosed(lanes), lanes.faults)
        case Call(function, arguments):
            return _apply(function, *(_evaluate(a, columns) for a in arguments))
        case LabelReference() | StateOperator():
            raise TypeError(f"not an arithmetic expression: {type(expression).__name__}")
        case _:
            assert_never(expression)


def _bound(error: float) -> Column | None:
    return np.asarray(error) if error else None


def _emit(op: Op, x: Column, y: Column) -> Column:
    """An operation of the register machine on doubles: the same one as in compiled code."""
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    return apply_to_doubles(op, x.ravel(), y.ravel()).reshape(x.shape)


_ERRORS: RunningErrors[Column] = RunningErrors(_emit, np.asarray)


def _enclosed(lanes: Lanes) -> Enclosed[Column]:
    """Numbers as doubles with bounds on their errors."""
    values, _, errors = lanes
    if values.dtype.kind == "f":
        return Enclosed(values, errors)
    doubles = values.astype(np.float64)
    if max(map(abs, _extremes(values)), default=0) <= LARGEST_WHOLE:
        return Enclosed(doubles, None)
    size = np.abs(doubles)  # the spacing of a negative number is negative
    return Enclosed(doubles, np.where(size < LARGEST_WHOLE, 0.0, np.spacing(size)))


def _decided(
    operation: Operator | Function,
    expression: Expression,
    columns: Mapping[str, Column],
    number: Enclosed[Column],
    faults: Bools | None,
) -> Lanes:
    """A comparison (of a difference with 0) or a rounding to an int."""
    is_bool = isinstance(operation, Operator)
    error = np.asarray(0.0) if number.error is None else number.error
    answers, unsure = _decide(DECISIONS[operation], number.value, error)
    lanes = Lanes(answers.astype(np.bool_) if is_bool else answers, faults)
    return _ask(expression, columns, lanes, unsure)


def _apply(operation: Operator | Function, *operands: Lanes) -> Lanes:
    """Apply an operation to numbers; a lane is faulty if the operation or an operand is."""
    if not is_on_doubles(operation, [o.values.dtype.kind == "f" for o in operands]):
        return compose(operation, _on_ints, operands)
    value, error = _ERRORS.apply(operation, *map(_enclosed, operands))
    return Lanes(value, _union(*(o.faults for o in operands)), error)


def _on_ints(instruction: Instruction, x: Lanes, y: Lanes) -> Lanes:
    values, faults, _ = _INTS[instruction](x.values, y.values)
    return Lanes(values, _union(faults, x.faults, y.faults))


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


def _extremes(values: Column) -> tuple[int, ...]:
    return (int(values.min()), int(values.max())) if values.size else ()


def _checked(values: Column) -> Lanes:
    """Python integers as int64; those beyond 64 bits are faults."""
    faults = np.asarray((values < INT_MIN) | (values > INT_MAX), np.bool_)
    return Lanes(np.where(faults, 0, values).astype(np.int64), _union(faults))


def _arithmetic(operation: Callable[[Any, Any], Any]) -> Callable[[Column, Column], Lanes]:
    """`+`, `-` or `*` of ints.

    The results at the extreme operands show whether an int result may exceed 64 bits.
    """

    def apply(x: Column, y: Column) -> Lanes:
        corners = [operation(a, b) for a in _extremes(x) for b in _extremes(y)]
        if all(INT_MIN <= c <= INT_MAX for c in corners):
            return Lanes(np.asarray(operation(x, y)))
        return _checked(np.asarray(operation(x.astype(object), y.astype(object)), object))

    return apply


_add = _arithmetic(op.add)
_subtract = _arithmetic(op.sub)


def _power(base: Column, exponent: Column) -> Lanes:
    faults = (exponent < 0) | ((exponent > _BITS) & ((base > 1) | (base < -1)))
    # The powers of -1, 0 and 1 depend on whether the exponent is 0 and whether it is odd.
    exponent = np.where(faults, 0, np.where(exponent > _BITS, _BITS - 1 + exponent % 2, exponent))
    largest = max(map(abs, _extremes(base)), default=0)
    if largest < 2 or largest ** max(_extremes(exponent), default=0) <= INT_MAX:
        return Lanes(np.asarray(np.power(base, exponent)), faults)
    values, beyond, _ = _checked(np.asarray(base.astype(object) ** exponent.astype(object), object))
    return Lanes(values, _union(faults, beyond))


def _modulo(dividend: Column, divisor: Column) -> Lanes:
    zero = divisor == 0
    remainder = np.fmod(dividend, np.where(zero | (divisor == -1), 1, divisor))
    values, beyond, _ = _add(remainder, np.where(remainder < 0, divisor, 0))
    return Lanes(values, _union(zero, beyond))


_INTS: Mapping[Instruction, Callable[[Column, Column], Lanes]] = complete(
    {
        Instruction.ADD: _add,
        Instruction.SUBTRACT: _subtract,
        Instruction.MULTIPLY: _arithmetic(op.mul),
        Instruction.POWER: _power,
        Instruction.REMAINDER: _modulo,
        Instruction.MINIMUM: lambda x, y: Lanes(np.minimum(x, y)),
        Instruction.MAXIMUM: lambda x, y: Lanes(np.maximum(x, y)),
    },
    [i for i in Instruction if i.ints is not None],
)
