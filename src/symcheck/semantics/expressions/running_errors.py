"""Doubles with bounds on their rounding errors, for conditions that must not depend on rounding.

A bound is computed beside its double. Where it does not decide a condition, exact arithmetic does
(`evaluate.py`). The formulas are written once, over the operations of the register machine: for
numpy arrays they are executed, and for code they are emitted.

Source: Higham (2002), Accuracy and stability of numerical algorithms, section 3.3 (running error
analysis).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import reduce
from math import e, inf, isfinite
from typing import Generic, NamedTuple, TypeVar, assert_never

from symcheck.kernels.explore.register_machine import Op
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.literals import to_float, to_signed_float
from symcheck.semantics.expressions.operations import Instruction, compose
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.traversal import children

__all__ = [
    "Enclosed",
    "RunningErrors",
    "is_accurate",
    "is_never_negative",
    "is_normal",
    "literal_error",
]

R = TypeVar("R")

_LIBRARY = 2.0**-45
"""A bound on the relative errors of C's pow and log."""
_LEAST_BOUND = 1e-300


class Enclosed(NamedTuple, Generic[R]):
    """A double, and a bound on the distance to the number that it stands for; None: 0."""

    value: R
    error: R | None


@dataclass(frozen=True)
class RunningErrors(Generic[R]):
    """Operations on doubles with bounds.

    Args:
        emit: an operation of the register machine on two doubles (the first twice, if it has one).
        constant: a constant double.
    """

    emit: Callable[[Op, R, R], R]
    constant: Callable[[float], R]

    def sum(self, *errors: R | None) -> R | None:
        """The sum of bounds."""
        present = [e for e in errors if e is not None]
        return reduce(lambda a, b: self.emit(Op.ADDD, a, b), present) if present else None

    def _scaled(self, x: R, error: R | None) -> R | None:
        return None if error is None else self.emit(Op.SCALE, x, error)

    def literal(self, value: Fraction | int) -> Enclosed[R]:
        """A literal."""
        error = literal_error(value)
        constant = self.constant(to_signed_float(value))
        return Enclosed(constant, self.constant(error) if error else None)

    def negative(self, x: Enclosed[R]) -> Enclosed[R]:
        """The negative number."""
        return Enclosed(self.emit(Op.NEGD, x.value, x.value), x.error)

    def add(self, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The sum."""
        rounding = self.emit(Op.ADDE, x.value, y.value)
        return Enclosed(self.emit(Op.ADDD, x.value, y.value), self.sum(x.error, y.error, rounding))

    def difference(self, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The difference, whose sign is right if the bound on the operands' errors says so."""
        return Enclosed(self.emit(Op.SUBD, x.value, y.value), self.sum(x.error, y.error))

    def multiply(self, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The product."""
        both = None if y.error is None else self._scaled(y.error, x.error)
        errors = self._scaled(x.value, y.error), self._scaled(y.value, x.error), both
        rounding = self.emit(Op.MULE, x.value, y.value)
        return Enclosed(self.emit(Op.MULD, x.value, y.value), self.sum(*errors, rounding))

    def divide(self, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The quotient."""
        quotient = self.emit(Op.DIVD, x.value, y.value)
        residual = self.emit(Op.DIVE, x.value, y.value)
        error = self.sum(x.error, self._scaled(quotient, y.error), residual)
        least = y.value if y.error is None else self.emit(Op.LESS, y.value, y.error)
        assert error is not None
        return Enclosed(quotient, self.emit(Op.SHARE, error, least))

    def power(self, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The power of x with exponent y."""
        power = self.emit(Op.POWD, x.value, y.value)
        base = None if x.error is None else self._relative(x)
        # The logarithm of the power changes by at most |y| base + |ln x| y.error + y.error base.
        changes = [self._scaled(y.value, base)]
        if y.error is not None:
            changes += [self._scaled(self._ln(x), y.error), self._scaled(y.error, base)]
        change = self.sum(*changes)
        relative: R = self.constant(_LIBRARY)
        if change is not None:
            grown = self.emit(Op.GROWTH, change, change)
            relative = self.emit(Op.ADDD, grown, relative)
        error = self.emit(Op.SCALE, power, relative)
        # What underflows has an error, and powers of an exact 0 have none.
        least = self.constant(_LEAST_BOUND)
        underflow = self.sum(
            self._scaled(x.value, least), None if x.error is None else self._scaled(x.error, least)
        )
        assert underflow is not None
        return Enclosed(power, self.emit(Op.MAXD, error, underflow))

    def log(self, x: Enclosed[R], base: Enclosed[R]) -> Enclosed[R]:
        """The logarithm of x."""
        logarithm = self.emit(Op.LOGD, x.value, base.value)
        error: R = self.emit(Op.SCALE, logarithm, self.constant(_LIBRARY))
        divisor = self._ln(base)
        changes: list[R | None] = []
        if base.error is not None:
            change = self._relative(base)
            changes.append(self._scaled(logarithm, change))
            divisor = self.emit(Op.LESS, divisor, change)
        if x.error is not None:
            changes.append(self._relative(x))
        total = self.sum(*changes)
        if total is not None:
            error = self.emit(Op.ADDD, error, self.emit(Op.SHARE, total, divisor))
        return Enclosed(logarithm, error)

    def _ln(self, x: Enclosed[R]) -> R:
        return self.emit(Op.LOGD, x.value, self.constant(e))

    def _relative(self, x: Enclosed[R]) -> R:
        """A bound on the change of ln x; NaN where x may be 0."""
        assert x.error is not None
        return self.emit(Op.SHARE, x.error, self.emit(Op.LESS, x.value, x.error))

    def extreme(self, op: Op, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        """The minimum or the maximum."""
        error = (
            y.error
            if x.error is None
            else x.error
            if y.error is None
            else self.emit(Op.MAXD, x.error, y.error)
        )
        return Enclosed(self.emit(op, x.value, y.value), error)

    def apply(self, operation: Operator | Function, *operands: Enclosed[R]) -> Enclosed[R]:
        """An operation on doubles that gives a double."""
        return compose(operation, self._execute, operands)

    def _execute(self, instruction: Instruction, x: Enclosed[R], y: Enclosed[R]) -> Enclosed[R]:
        match instruction:
            case Instruction.ADD:
                return self.add(x, y)
            case Instruction.SUBTRACT:
                return self.add(x, self.negative(y))
            case Instruction.MULTIPLY:
                return self.multiply(x, y)
            case Instruction.DIVIDE:
                return self.divide(x, y)
            case Instruction.POWER:
                return self.power(x, y)
            case Instruction.LOGARITHM:
                return self.log(x, y)
            case Instruction.MINIMUM:
                return self.extreme(Op.MIND, x, y)
            case Instruction.MAXIMUM:
                return self.extreme(Op.MAXD, x, y)
            case Instruction.REMAINDER:
                raise TypeError("doubles have no remainder")
            case _:
                assert_never(instruction)


def literal_error(value: Fraction | int) -> float:
    """A bound on the rounding error of a literal; 0 if it is a double."""
    nearest = to_float(value)
    if not isfinite(nearest):
        return inf
    error = abs(Fraction(nearest) - value)
    return max(to_float(error) * 1.0000001, _LEAST_BOUND) if error else 0.0


_NORMAL_BITS = 1000
_INT_BITS = 64


def _bits(expression: Expression, type_of: Callable[[Expression], Type]) -> int:
    """A bound on how many powers of 2 an expression without differences is away from 1, if it is
    not 0; infinities and what follows from them apart.
    """
    if type_of(expression) is not Type.DOUBLE:
        return _INT_BITS
    match expression:
        case Literal(value):
            size = Fraction(value)
            return max(size.numerator.bit_length(), size.denominator.bit_length())
        case _:
            operands = [e for e in children(expression) if isinstance(e, Expression)]
            return 1 + sum(_bits(e, type_of) for e in operands)


def is_accurate(
    expression: Expression,
    type_of: Callable[[Expression], Type],
    is_natural: Callable[[str], bool],
) -> bool:
    """Whether no rounding error of an expression is large relative to its value: it cancels
    nowhere, so that its sign is right, too.

    Args:
        expression: the expression.
        type_of: the type of a subexpression.
        is_natural: whether a variable is never negative.
    """

    def accurate(node: Expression) -> bool:
        if type_of(node) is not Type.DOUBLE:
            return True
        match node:
            case Literal():
                return True
            case Unary(_, operand):
                return accurate(operand)
            case Conditional(_, x, y) | Binary(Operator.TIMES | Operator.DIVIDE, x, y):
                return accurate(x) and accurate(y)
            case Binary(Operator.PLUS, x, y):
                return accurate(x) and accurate(y) and natural(x) and natural(y)
            case Call(Function.MIN | Function.MAX, arguments):
                return all(map(accurate, arguments))
            case _:
                return False

    def natural(node: Expression) -> bool:
        return is_never_negative(
            node, is_natural, lambda part: isinstance(part, Literal) and part.value >= 0
        )

    return accurate(expression) and is_normal(expression, type_of)


def is_never_negative(
    expression: Expression,
    is_natural: Callable[[str], bool],
    is_natural_part: Callable[[Expression], bool],
) -> bool:
    """Whether an expression is plainly never negative: sums, products, quotients and choices are
    not if their parts are not.

    Args:
        expression: the expression.
        is_natural: whether a variable is never negative.
        is_natural_part: the same of another part, such as a literal.
    """
    match expression:
        case Name(name):
            return is_natural(name)
        case Binary(Operator.PLUS | Operator.TIMES | Operator.DIVIDE, x, y) | Conditional(_, x, y):
            return all(is_never_negative(part, is_natural, is_natural_part) for part in (x, y))
        case _:
            return is_natural_part(expression)


def is_normal(expression: Expression, type_of: Callable[[Expression], Type]) -> bool:
    """Whether no operation of an expression without differences can underflow or overflow."""
    return _bits(expression, type_of) < _NORMAL_BITS
