"""Sets of states as bool arrays, and values as float64 arrays of lower and upper bounds, in index
order.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import cached_property, partial
from math import fsum, isfinite, nan
from typing import Protocol, assert_never

import numpy as np

from symcheck.engines.base import ROUNDING, bracket
from symcheck.kernels.explore.register_machine import Op, apply_to_doubles
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, LEAST_NORMAL, to_float
from symcheck.semantics.expressions.operations import Instruction, compose
from symcheck.syntax.operators import (
    OPERATOR_BY_TOKEN,
    Function,
    Operation,
    Operator,
    Signature,
    UnaryOperator,
    complete,
)

__all__ = ["ArraySet", "ArrayValues", "Known", "total_of"]


@dataclass(frozen=True, eq=False)
class ArraySet:
    """A set of states: `members` is bool[states], never written to."""

    members: Bools = field(repr=False)

    @classmethod
    def of(cls, states: int, indices: Int32s | Int64s | int) -> ArraySet:
        """The set of some states (by index) of a model with so many states."""
        members = np.zeros(states, bool)
        members[indices] = True
        return cls(members)

    @cached_property
    def count(self) -> int:
        """Number of states in the set."""
        return int(np.count_nonzero(self.members))

    def __and__(self, other: ArraySet, /) -> ArraySet:
        return ArraySet(self.members & other.members)

    def __or__(self, other: ArraySet, /) -> ArraySet:
        return ArraySet(self.members | other.members)

    def __sub__(self, other: ArraySet, /) -> ArraySet:
        return ArraySet(self.members & ~other.members)

    def __invert__(self) -> ArraySet:
        return ArraySet(~self.members)

    def __bool__(self) -> bool:
        return bool(self.members.any())

    def __eq__(self, other: object, /) -> bool:
        return isinstance(other, ArraySet) and np.array_equal(self.members, other.members)

    def __le__(self, other: ArraySet, /) -> bool:
        return not bool(np.any(self.members & ~other.members))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<ArraySet of {self.count:,} of {len(self.members):,} states>"


@dataclass(frozen=True, eq=False)
class ArrayValues:
    """Values between `lower` and `upper`, float64[states] each (the same array where exact).

    `computed` (bool[states], None: nowhere) marks values that were computed in floating point. They
    are known up to rounding even if lower and upper are equal: within ROUNDING relatively and
    `slack` absolutely (float64[states], or a number for all: a difference inherits the rounding of
    its operands, which is large relative to a small value).
    """

    lower: Floats = field(repr=False)
    upper: Floats = field(repr=False)
    computed: Bools | None = field(default=None, repr=False)
    slack: Floats | float = field(default=0.0, repr=False)

    @cached_property
    def is_point(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return self.lower is self.upper or np.array_equal(self.lower, self.upper, equal_nan=True)

    def __repr__(self) -> str:
        kind = "exact" if self.is_point else "certified"
        return f"<ArrayValues of {len(self.lower):,} states, {kind}>"

    def rounded(self, states: ArraySet) -> bool:
        """Whether some value over the set was computed in floating point."""
        return self.computed is not None and bool(np.any(self.computed & states.members))

    def at(self, states: ArraySet) -> tuple[Floats, Floats]:
        """Lower and upper values over the set, in index order."""
        return self.lower[states.members], self.upper[states.members]

    def minimum(self, states: ArraySet) -> tuple[float, float]:
        """Bounds of the least value over the set."""
        return float(self.lower[states.members].min()), float(self.upper[states.members].min())

    def maximum(self, states: ArraySet) -> tuple[float, float]:
        """Bounds of the largest value over the set."""
        return float(self.lower[states.members].max()), float(self.upper[states.members].max())

    def total(self, states: ArraySet) -> tuple[float, float]:
        """Bounds of the sum over the set."""
        return total_of([(self.gather(np.flatnonzero(states.members)), 1)])

    def _margins(self) -> tuple[Floats, Floats]:
        """Lower and upper values, made wider by the rounding that a computed value may carry."""
        if self.computed is None:
            return self.lower, self.upper
        with np.errstate(invalid="ignore"):
            low = np.where(
                self.computed, self.lower - (ROUNDING * np.abs(self.lower) + self.slack), self.lower
            )
            high = np.where(
                self.computed, self.upper + (ROUNDING * np.abs(self.upper) + self.slack), self.upper
            )
        # An infinite value minus an infinite margin is NaN.
        return np.where(np.isinf(self.lower), self.lower, low), np.where(
            np.isinf(self.upper), self.upper, high
        )

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[ArraySet, ArraySet]:
        """The states that surely satisfy the comparison, and the undecided ones.

        Comparisons with NaN are false.
        """
        below, above = bracket(threshold)
        low, high = self._margins()
        with np.errstate(invalid="ignore"):
            yes, no = _COMPARISONS[OPERATOR_BY_TOKEN[operator]](low, high, below, above)
            nan = np.isnan(low) | np.isnan(high)
        return ArraySet(yes), ArraySet(~(yes | no | nan))

    def map(
        self, operation: Operation, *others: ArrayValues | Known | float | Fraction
    ) -> ArrayValues:
        """Interval arithmetic with an operator or function of the expression language."""
        with np.errstate(all="ignore"):
            if isinstance(operation, UnaryOperator):
                return self._negative()
            if operation.signature is Signature.ROUNDING:
                # A value at a jump of floor or ceil may lie on either side of it: rounding must not
                # choose.
                low, high = map(_ROUNDINGS[operation], self._margins())
                return ArrayValues(*_same(_unsigned(low), _unsigned(high)))
            operands = [self, *(_operand(o, len(self.lower)) for o in others)]
            return compose(operation, _calculated, operands)

    def _negative(self) -> ArrayValues:
        if self.is_point:
            value = _unsigned(-self.lower)
            return _without_cancellation(ArrayValues(value, value, self.computed, self.slack))
        low, high = self._margins()
        return ArrayValues(*_same(_unsigned(-high), _unsigned(-low)))

    def choose(self, states: ArraySet, other: ArrayValues | Known) -> ArrayValues:
        """These values on the set, the other ones elsewhere."""
        m = states.members
        other = _operand(other, len(m))
        lower = np.where(m, self.lower, other.lower)
        upper = lower if self.is_point and other.is_point else np.where(m, self.upper, other.upper)
        empty = np.zeros(len(m), bool)
        if self.computed is None and other.computed is None:
            return ArrayValues(lower, upper)
        mine, theirs = (empty if c is None else c for c in (self.computed, other.computed))
        return ArrayValues(
            lower, upper, np.where(m, mine, theirs), np.where(m, self.slack, other.slack)
        )

    def gather(self, indices: Int32s | Int64s) -> ArrayValues:
        """The values at some states (repetitions allowed), as values of as many states."""
        lower = self.lower[indices]
        upper = lower if self.upper is self.lower else self.upper[indices]
        computed = None if self.computed is None else self.computed[indices]
        slack = np.broadcast_to(self.slack, self.lower.shape)[indices]
        return ArrayValues(lower, upper, computed, slack)


class Known(Protocol):
    """Values without an error, which have doubles near them."""

    def in_doubles(self) -> ArrayValues:
        """The nearest doubles; those that differ are marked as computed."""
        ...


def _operand(value: ArrayValues | Known | float | Fraction, n: int) -> ArrayValues:
    if isinstance(value, ArrayValues):
        return value
    if isinstance(value, int | float | Fraction):
        return _broadcast(value, n)
    return value.in_doubles()


def total_of(parts: Sequence[tuple[ArrayValues, int]]) -> tuple[float, float]:
    """Bounds of the sum of all values, each counted so many times.

    They are equal if the sum is exact up to rounding: no summands of opposite signs leave little,
    and none has bounds, be they too small to change the sum.
    """
    lower = upper = error = size = 0.0
    between = False
    for values, times in parts:
        between = between or not values.is_point
        low, high = times * _sum(values.lower), times * _sum(values.upper)
        lower, upper, size = lower + low, upper + high, size + max(abs(low), abs(high))
        if values.computed is not None:
            known = np.isfinite(values.lower) & values.computed
            slack = np.broadcast_to(values.slack, known.shape)[known]
            error += times * _sum(ROUNDING * np.abs(values.lower[known]) + slack)
    finite = all(np.isfinite(v.lower).all() and np.isfinite(v.upper).all() for v, _ in parts)
    if finite and not (isfinite(lower) and isfinite(upper)):  # the sum is no double
        return min(lower, _LARGEST), max(upper, -_LARGEST)
    if between or error > _CANCELLATION * ROUNDING * max(abs(lower), abs(upper)):
        lower, upper = lower - error, upper + error
    if between and isfinite(size):  # rounded outwards, enough for an average too
        error = (len(parts) + 4) * UNIT_ROUNDOFF * size
        return (lower - error if lower else lower), upper + error
    return lower, upper


def _without_cancellation(values: ArrayValues) -> ArrayValues:
    """Values with bounds where the rounding of summands is not small relative to their sum."""
    value, computed = values.lower, values.computed
    if computed is None or np.ndim(values.slack) == 0:
        return values
    magnitude = np.abs(value)
    few = computed & np.isfinite(value) & (values.slack > _CANCELLATION * ROUNDING * magnitude)
    if not few.any():
        return values
    error = np.where(few, values.slack + ROUNDING * magnitude, 0.0)
    return ArrayValues(value - error, value + error, computed & ~few, values.slack)


def _around(values: ArrayValues, tiny: Bools) -> ArrayValues:
    """Values with bounds where they are below the least normal double."""
    if not tiny.any():
        return values
    error = np.where(tiny, LEAST_NORMAL, 0.0)
    computed = None if values.computed is None else values.computed & ~tiny
    return ArrayValues(values.lower - error, values.upper + error, computed, values.slack)


def _outside(instruction: Instruction, x: Floats, y: Floats, value: Floats) -> tuple[Bools, Bools]:
    """Where the result for finite numbers is 0 or nearly, and is not 0; and where it is beyond
    doubles (1/0 is infinite).
    """
    finite = np.isfinite(x) & np.isfinite(y)
    tiny, large = finite & (x != 0) & (np.abs(value) < LEAST_NORMAL), finite & np.isinf(value)
    match instruction:
        case Instruction.ADD | Instruction.SUBTRACT:
            return finite & False, large
        case Instruction.MULTIPLY:
            return tiny & (y != 0), large
        case Instruction.DIVIDE:
            return tiny, large & (y != 0)
        case Instruction.POWER:
            return tiny, large & (x != 0)
        case (
            Instruction.REMAINDER
            | Instruction.LOGARITHM
            | Instruction.MINIMUM
            | Instruction.MAXIMUM
        ):
            return finite & False, finite & False
        case _:
            assert_never(instruction)


def _beyond(values: ArrayValues, overflow: Bools) -> ArrayValues:
    """Values with bounds where they are finite, but no double."""
    if not overflow.any():
        return values
    largest = np.copysign(_LARGEST, values.lower)
    lower = np.where(overflow, np.minimum(values.lower, largest), values.lower)
    upper = np.where(overflow, np.maximum(values.upper, largest), values.upper)
    computed = None if values.computed is None else values.computed & ~overflow
    return ArrayValues(lower, upper, computed, values.slack)


_LARGEST = sys.float_info.max
_CANCELLATION = 100.0
"""How much greater than a sum its summands may be: two of sixteen digits are lost."""


def _sum(values: Floats) -> float:
    try:
        return fsum(values.tolist())
    except OverflowError:  # a partial sum is beyond doubles
        infinite = values[~np.isfinite(values)]
        if len(infinite):
            return _sum(infinite)
        return to_float(sum(map(Fraction, values.tolist()), Fraction(0)))
    except ValueError:  # infinities of both signs
        return nan


_Pair = tuple[Floats, Floats]
_Decision = tuple[Bools, Bools]

# Each gives the states where the comparison surely holds, and where it surely fails. For a
# threshold t that is not a double, `below` < t < `above` are its neighbours, so that v >= t is v >=
# above, and v > t is v > below.
_COMPARISONS: Mapping[Operator, Callable[[Floats, Floats, float, float], _Decision]] = complete(
    {
        Operator.GE: lambda low, high, _, above: (low >= above, high < above),
        Operator.GT: lambda low, high, below, _: (low > below, high <= below),
        Operator.LE: lambda low, high, below, _: (high <= below, low > below),
        Operator.LT: lambda low, high, _, above: (high < above, low >= above),
        Operator.EQ: lambda low, high, below, above: (
            (low == high) & (low == below) & (below == above),
            (low > below) | (high < above),
        ),
        Operator.NE: lambda low, high, below, above: (
            (low > below) | (high < above),
            (low == high) & (low == below) & (below == above),
        ),
    },
    [o for o in Operator if o.is_comparison],
)


def _calculated(instruction: Instruction, x: ArrayValues, y: ArrayValues) -> ArrayValues:
    slack = _slack(instruction, x, y)
    if slack is not None and x.is_point and y.is_point:
        value = _unsigned(_POINTS[instruction](x.lower, y.lower))
        computed = _any((x.computed, y.computed))
        if computed is None:
            computed = _rounded(instruction, x.lower, y.lower, value)
        known = _without_cancellation(ArrayValues(value, value, computed, slack))
        tiny, large = _outside(instruction, x.lower, y.lower, value)
        return _beyond(_around(known, tiny), large)
    low, high = _interval(instruction, x._margins(), y._margins())
    tiny, large = _outside(instruction, x.lower, y.lower, low)
    also_tiny, also_large = _outside(instruction, x.upper, y.upper, high)
    between = ArrayValues(*_same(_unsigned(low), _unsigned(high)))
    return _beyond(_around(between, tiny & also_tiny), large | also_large)


def _rounded(instruction: Instruction, x: Floats, y: Floats, value: Floats) -> Bools | None:
    """Where the result for known values may have been rounded; None: nowhere.

    Arithmetic of whole numbers is exact, and so is anything with infinities.
    """
    finite = np.isfinite(value)
    rounded = finite & ((np.abs(value) >= LARGEST_WHOLE) | (value != np.floor(value)))
    for operand in (x, y):
        rounded |= finite & np.isfinite(operand) & (operand != np.floor(operand))
    match instruction:
        case Instruction.MINIMUM | Instruction.MAXIMUM:
            return None
        case Instruction.ADD | Instruction.SUBTRACT:
            rounded &= (x != 0) & (y != 0)
        case Instruction.MULTIPLY:
            rounded &= (x != 0) & (x != 1) & (y != 1)
        case Instruction.DIVIDE:
            rounded &= (x != 0) & (y != 1)
            rounded |= finite & (np.abs(x) > LARGEST_WHOLE)  # perhaps to a whole number
        case Instruction.POWER:
            rounded |= (value == 0) & (x != 0)
        case Instruction.LOGARITHM:
            rounded |= value != 0
        case Instruction.REMAINDER:
            pass
        case _:
            assert_never(instruction)
    return rounded if rounded.any() else None


def _slack(instruction: Instruction, x: ArrayValues, y: ArrayValues) -> Floats | float | None:
    """The absolute error of the result for rounded values.

    None if interval arithmetic must compute it.
    """
    slack = x.slack + y.slack
    if x.computed is None and y.computed is None:
        return slack
    match instruction:
        case Instruction.MINIMUM | Instruction.MAXIMUM:
            return slack
        case Instruction.ADD | Instruction.SUBTRACT:
            return slack + ROUNDING * _computed_magnitude(x) + ROUNDING * _computed_magnitude(y)
        case Instruction.MULTIPLY | Instruction.DIVIDE:
            return None if np.any(slack) else 0.0
        case Instruction.POWER | Instruction.REMAINDER | Instruction.LOGARITHM:
            return None
        case _:
            assert_never(instruction)


def _computed_magnitude(values: ArrayValues) -> Floats | float:
    """The absolute value where it is finite and was computed, else 0."""
    if values.computed is None:
        return 0.0
    return np.where(values.computed & np.isfinite(values.lower), np.abs(values.lower), 0.0)


def _broadcast(value: float | Fraction, n: int) -> ArrayValues:
    array = np.full(n, float(value))
    return ArrayValues(array, array)


def _any(masks: Iterable[Bools | None]) -> Bools | None:
    result: Bools | None = None
    for mask in masks:
        if mask is not None:
            result = mask if result is None else result | mask
    return result


def _same(low: Floats, high: Floats) -> _Pair:
    return (low, low) if np.array_equal(low, high, equal_nan=True) else (low, high)


def _unsigned(values: Floats) -> Floats:
    """The values with zeros of one sign, as rationals have them: bounds are no sides of zero."""
    return np.asarray(values + 0.0)


def _remainder(x: Floats, y: Floats) -> Floats:
    """`mod` as `symcheck.semantics.expressions.evaluate` defines it; NaN for y = 0."""
    remainder = np.fmod(x, y)
    return np.where(remainder < 0, remainder + y, remainder)


def _round(x: Floats) -> Floats:
    """The nearest ints, upwards from the middle; x + 0.5 would be rounded."""
    whole = np.floor(x)
    return np.where(x - whole >= 0.5, whole + 1, whole)


_ROUNDINGS: Mapping[Operator | Function, Callable[[Floats], Floats]] = complete(
    {Function.FLOOR: np.floor, Function.CEIL: np.ceil, Function.ROUND: _round},
    [f for f in Function if f.signature is Signature.ROUNDING],
)

_POINTS: Mapping[Instruction, Callable[[Floats, Floats], Floats]] = complete(
    {
        Instruction.ADD: np.add,
        Instruction.SUBTRACT: np.subtract,
        Instruction.MULTIPLY: np.multiply,
        Instruction.DIVIDE: np.divide,
        Instruction.MINIMUM: np.minimum,
        Instruction.MAXIMUM: np.maximum,
        Instruction.POWER: partial(apply_to_doubles, Op.POWD),
        Instruction.REMAINDER: _remainder,
        Instruction.LOGARITHM: partial(apply_to_doubles, Op.LOGD),
    },
    Instruction,
)


def _interval(instruction: Instruction, x: _Pair, y: _Pair) -> _Pair:
    """Bounds of the result for numbers between bounds."""
    wide = (x[0] != x[1]) | (y[0] != y[1])
    low, high = _corners(instruction, x, y)
    rounded: Bools = low != high  # of numbers that are known it has the value
    match instruction:
        case Instruction.MINIMUM | Instruction.MAXIMUM:
            return low, high
        case Instruction.ADD:
            rounded = wide
        case Instruction.SUBTRACT:
            low, high, rounded = x[0] - y[1], x[1] - y[0], wide
        case Instruction.MULTIPLY:
            rounded = wide & ~_is_zero(x) & ~_is_zero(y)
        case Instruction.DIVIDE:
            low, high = _unless((y[0] <= 0) & (y[1] >= 0) & (y[0] != y[1]), low, high)
            rounded = wide & ~_is_zero(x)
        case Instruction.POWER:
            # With a base that may be negative, or zero under a negative exponent, it is not
            # monotone: say that nothing is known.
            below = (x[0] < 0) | ((x[0] == 0) & (y[0] < 0))
            low, high = _unless(below & wide, low, high)
            rounded = low != high
        case Instruction.REMAINDER:
            low, high = _remainders(x, y)
            rounded = low != high
        case Instruction.LOGARITHM:
            low, high = _unless((y[0] <= 1) & (y[1] >= 1) & (y[0] != y[1]), low, high)
        case _:
            assert_never(instruction)
    return _outward(low, high, rounded)


def _unless(unknown: Bools, low: Floats, high: Floats) -> _Pair:
    """Bounds that are infinite where nothing is known."""
    return np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)


def _is_zero(x: _Pair) -> Bools:
    return np.asarray((x[0] == 0) & (x[1] == 0))


def _outward(low: Floats, high: Floats, rounded: Bools) -> _Pair:
    """Wider by one unit in the last place, where they were rounded."""
    return np.where(rounded, np.nextafter(low, -np.inf), low), np.where(
        rounded, np.nextafter(high, np.inf), high
    )


def _corners(instruction: Instruction, x: _Pair, y: _Pair) -> _Pair:
    """Extreme values at the corners, for what is monotone in each operand."""
    values = [_POINTS[instruction](a, b) for a in x for b in y]
    return np.minimum.reduce(values), np.maximum.reduce(values)


def _remainders(x: _Pair, y: _Pair) -> _Pair:
    point = (y[0] == y[1]) & (np.floor(x[0] / y[0]) == np.floor(x[1] / y[1])) & (y[0] > 0)
    high = np.where(_is_zero(y), np.nan, np.maximum(np.abs(y[0]), np.abs(y[1])))
    low = np.where(_is_zero(y), np.nan, np.minimum(2 * y[0], 0.0))
    return np.where(point, np.mod(x[0], y[0]), low), np.where(point, np.mod(x[1], y[0]), high)
