"""Rational values, one per state: arrays of Fraction objects (infinities and NaN are floats)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from fractions import Fraction
from functools import partial, reduce
from math import isfinite, nan
from typing import Any

import numpy as np

from symcheck.engines.base import bracket
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Rationals, rationals
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.matrices.rows import Int64s
from symcheck.semantics.expressions.evaluate import apply_exactly
from symcheck.semantics.expressions.literals import LEAST_NORMAL, to_float
from symcheck.semantics.model import Value
from symcheck.syntax.operators import (
    OPERATOR_BY_TOKEN,
    Function,
    Operation,
    Operator,
    Signature,
    UnaryOperator,
)

__all__ = ["RationalValues", "in_doubles"]

Rational = Fraction | float
"""A Fraction, or a float that is infinite or NaN."""


@dataclass(frozen=True, eq=False)
class RationalValues:
    """An exact value per state (see `symcheck.engines.base.Values`).

    All values of the exact engine are rational; those of expressions over variables are on every
    engine. Together with doubles they become doubles.
    """

    array: Rationals = field(repr=False)

    @property
    def is_point(self) -> bool:
        """Always: there is one bound."""
        return True

    @property
    def lower(self) -> Rationals:
        """The values."""
        return self.array

    @property
    def upper(self) -> Rationals:
        """The values."""
        return self.array

    @property
    def computed(self) -> None:
        """No value was computed in floating point."""
        return

    def in_doubles(self) -> ArrayValues:
        """The doubles beside them; those that differ are marked as computed."""
        low = np.array([to_float(v) for v in self.array])
        differs = np.array([x != v == v for x, v in zip(low, self.array, strict=True)], bool)
        if not differs.any():
            return ArrayValues(low, low)
        high = low.copy()
        # Beyond the range of normal doubles the nearest one is not near.
        far = differs & (np.isinf(low) | (np.abs(low) < LEAST_NORMAL))
        for i in np.flatnonzero(differs).tolist():
            low[i], high[i] = bracket(self.array[i])
        return ArrayValues(low, high, differs & ~far)

    def __repr__(self) -> str:
        return f"<RationalValues of {len(self.array):,} states>"

    def rounded(self, states: ArraySet) -> bool:  # noqa: ARG002
        """Never: the values are rational."""
        return False

    def at(self, states: ArraySet) -> tuple[Rationals, Rationals]:
        """The values over the set, twice."""
        chosen = self.array[states.members]
        return chosen, chosen

    def minimum(self, states: ArraySet) -> tuple[Rational, Rational]:
        """The least value over the set, twice; NaN if there is one."""
        least = _exactly(Function.MIN, *self.array[states.members])
        return least, least

    def maximum(self, states: ArraySet) -> tuple[Rational, Rational]:
        """The greatest value over the set, twice; NaN if there is one."""
        greatest = _exactly(Function.MAX, *self.array[states.members])
        return greatest, greatest

    def total(self, states: ArraySet) -> tuple[Rational, Rational]:
        """The sum over the set, twice."""
        zero: Rational = Fraction(0)
        total = reduce(partial(_exactly, Operator.PLUS), self.array[states.members], zero)
        return total, total

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[ArraySet, ArraySet]:
        """The states that satisfy the comparison; nothing is undecided."""
        compare = OPERATOR_BY_TOKEN[operator].compare
        members = np.fromiter((compare(v, threshold) for v in self.array), bool, len(self.array))
        return ArraySet(members), ArraySet(np.zeros(len(members), bool))

    def map(
        self, operation: Operation, *others: RationalValues | ArrayValues | float | Fraction
    ) -> RationalValues | ArrayValues:
        """An operator or function of the expression language, applied at each state."""
        if any(isinstance(o, ArrayValues) for o in others):
            return self.in_doubles().map(operation, *others)
        if isinstance(operation, UnaryOperator):
            return RationalValues(rationals([-v for v in self.array]))
        columns = [
            o.array if isinstance(o, RationalValues) else [o] * len(self.array) for o in others
        ]
        return RationalValues(
            rationals(
                _exactly(operation, *values) for values in zip(self.array, *columns, strict=True)
            )
        )

    def choose(
        self, states: ArraySet, other: RationalValues | ArrayValues
    ) -> RationalValues | ArrayValues:
        """These values on the set, the other ones elsewhere."""
        if isinstance(other, ArrayValues):
            return self.in_doubles().choose(states, other)
        return RationalValues(np.where(states.members, self.array, other.array))

    def gather(self, indices: Int64s) -> RationalValues:
        """The values at some states (int64, repetitions allowed), as values of as many states."""
        return RationalValues(self.array[indices])


def in_doubles(values: ArrayValues | RationalValues) -> ArrayValues:
    """Values as doubles."""
    return values if isinstance(values, ArrayValues) else values.in_doubles()


def _exactly(operation: Operator | Function, *values: Rational) -> Rational:
    """The exact value of an operator or function, as the scalar evaluator has it.

    Where that is an error, because an int is no infinity and no remainder by zero, the value
    is the operand or NaN: not every state is relevant.
    """
    if any(isinstance(v, RationalFunction) for v in values):
        found: Rational = apply_to_functions(operation, *values)
        return found
    operands: Sequence[Value] = values
    if operation.signature is Signature.ROUNDING and not isfinite(values[0]):
        return values[0]
    if operation.signature is Signature.INTEGER:
        if not all(map(isfinite, values)) or (operation is Function.MOD and values[1] == 0):
            return nan
        operands = [int(v) for v in values]
    return _rational(apply_exactly(operation, *operands))


def _rational(value: Value) -> Rational:
    return Fraction(value) if isinstance(value, int) else value


def apply_to_functions(operation: Operator | Function, *values: Any) -> Any:
    """The value of an operator or function of rational functions. Raises UnsupportedError."""
    from symcheck.semantics.binding.parameters import FIELD

    if operation in FIELD and any(isinstance(v, float) and not isfinite(v) for v in values):
        # Beside an infinity, the sign of a function matters alone.
        signs = [(v > 0) - (v < 0) if isinstance(v, RationalFunction) else v for v in values]
        return _rational(apply_exactly(operation, *signs))
    if operation in (Function.MIN, Function.MAX):
        return (min if operation is Function.MIN else max)(values)
    if operation in (Operator.POWER, Function.POW):
        base, exponent = values
        if not isinstance(exponent, RationalFunction) and exponent % 1 == 0:
            return base ** int(exponent)
    if operation in FIELD:
        return FIELD[operation](*values)
    raise UnsupportedError(f"{operation!s} of functions of parameters is no rational function")
