"""Rational values, one per state: arrays of Fraction objects (infinities and NaN are floats)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from fractions import Fraction
from functools import reduce
from math import inf, isfinite, nan, nextafter
from operator import eq, ge, gt, le, lt, ne

import numpy as np

from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Rationals, rationals
from symcheck.matrices.rows import Int64s
from symcheck.semantics.expressions.evaluate import BINARY, FUNCTIONS
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Name
from symcheck.syntax.operators import FUNCTION_BY_NAME, OPERATOR_BY_TOKEN, Function

__all__ = ["RationalValues", "enclosure", "in_doubles"]

Rational = Fraction | float
"""A Fraction, or a float that is infinite or NaN."""


_LEAST_NORMAL = 2.0**-1022


@dataclass(frozen=True, eq=False)
class RationalValues:
    """An exact value per state (see `symcheck.engines.base.Values`).

    All values of the exact engine are rational; those of expressions over variables are on every
    engine. Together with doubles they become doubles.
    """

    array: Rationals = field(repr=False)

    @property
    def exact(self) -> bool:
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
        """The nearest doubles; those that differ are marked as computed."""
        low = np.array([to_float(v) for v in self.array])
        differs = np.array([x != v == v for x, v in zip(low, self.array, strict=True)], bool)
        if not differs.any():
            return ArrayValues(low, low)
        high = low.copy()
        # Beyond the range of normal doubles the nearest one is not near.
        far = differs & (np.isinf(low) | (np.abs(low) < _LEAST_NORMAL))
        for i in np.flatnonzero(far).tolist():
            low[i], high[i] = enclosure(self.array[i])
        return ArrayValues(low, high if far.any() else low, differs & ~far)

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
        least = _function("min")(*self.array[states.members])
        return least, least

    def maximum(self, states: ArraySet) -> tuple[Rational, Rational]:
        """The greatest value over the set, twice; NaN if there is one."""
        greatest = _function("max")(*self.array[states.members])
        return greatest, greatest

    def total(self, states: ArraySet) -> tuple[Rational, Rational]:
        """The sum over the set, twice."""
        zero: Rational = Fraction(0)
        total = reduce(_function("+"), self.array[states.members], zero)
        return total, total

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[ArraySet, ArraySet]:
        """The states that satisfy the comparison; nothing is undecided."""
        test = _COMPARISONS[operator]
        members = np.fromiter((test(v, threshold) for v in self.array), bool, len(self.array))
        return ArraySet(members), ArraySet(np.zeros(len(members), bool))

    def map(
        self, operator: str, *others: RationalValues | ArrayValues | float | Fraction
    ) -> RationalValues | ArrayValues:
        """An operator of the expression language, applied at each state."""
        if any(isinstance(o, ArrayValues) for o in others):
            return self.in_doubles().map(operator, *others)
        if operator == "-" and not others:
            return RationalValues(rationals([-v for v in self.array]))
        apply = _function(operator)
        columns = [
            o.array if isinstance(o, RationalValues) else [o] * len(self.array) for o in others
        ]
        return RationalValues(
            rationals(apply(*values) for values in zip(self.array, *columns, strict=True))
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


def enclosure(value: Fraction) -> tuple[float, float]:
    """The greatest double below a rational number that no double is, and the least above it."""
    near = to_float(value)
    return (near, nextafter(near, inf)) if near < value else (nextafter(near, -inf), near)


_COMPARISONS: dict[str, Callable[[Rational, Rational], bool]] = {
    "<": lt,
    "<=": le,
    ">": gt,
    ">=": ge,
    "=": eq,
    "!=": ne,
}


def _function(operator: str) -> Callable[..., Rational]:
    """The exact meaning of an operator, as the scalar evaluator has it.

    Where that is an error, because an int is no infinity and no remainder by zero, the value
    is the operand or NaN: not every state is relevant.
    """
    if operator in OPERATOR_BY_TOKEN:
        binary = BINARY[OPERATOR_BY_TOKEN[operator]]
        return lambda x, y: _rational(binary(x, y, True, _NODE))
    function = FUNCTION_BY_NAME[operator]
    meaning = FUNCTIONS[function]

    def apply(*values: Rational) -> Rational:
        match function:
            case Function.FLOOR | Function.CEIL | Function.ROUND if not isfinite(values[0]):
                return values[0]
            case Function.MOD:
                if not all(map(isfinite, values)) or values[1] == 0:
                    return nan
                return _rational(meaning([int(v) for v in values], True, _NODE))
            case _:
                return _rational(meaning(values, True, _NODE))

    return apply


def _rational(value: Value) -> Rational:
    return Fraction(value) if isinstance(value, int) else value


_NODE = Name("the value of a property")
"""Stands for the expression in errors."""
