"""Sets of states as bool arrays, and values as float64 arrays of lower and upper bounds, in index
order.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from functools import cached_property, partial
from math import fsum, isfinite, isinf, nan
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

__all__ = ["ArraySet", "ArrayValues", "Known", "around", "total_of"]


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

    `computed` (bool[states], None: nowhere) marks values whose bounds differ by rounding alone.
    """

    lower: Floats = field(repr=False)
    upper: Floats = field(repr=False)
    computed: Bools | None = field(default=None, repr=False)

    @cached_property
    def is_point(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return self.lower is self.upper or np.array_equal(self.lower, self.upper, equal_nan=True)

    @cached_property
    def _between(self) -> Bools:
        """The values whose bounds do not differ by rounding alone, bool[states]."""
        apart: Bools = self.lower != self.upper
        return apart if self.computed is None else apart & ~self.computed

    def __repr__(self) -> str:
        kind = "exact" if self.is_point else "certified"
        return f"<ArrayValues of {len(self.lower):,} states, {kind}>"

    def rounded(self, states: ArraySet) -> bool:
        """Whether some value over the set was rounded, and all bounds differ by that alone."""
        members = states.members
        return (
            self.computed is not None
            and bool(np.any(self.computed & members))
            and (self.is_point or not np.any(self._between & members & ~np.isnan(self.lower)))
        )

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

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[ArraySet, ArraySet]:
        """The states that surely satisfy the comparison, and the undecided ones.

        Comparisons with NaN are false.
        """
        below, above = bracket(threshold)
        low, high = self.lower, self.upper
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
                low, high = map(_ROUNDINGS[operation], (self.lower, self.upper))
                return ArrayValues(*_same(_unsigned(low), _unsigned(high)))
            operands = [self, *(_operand(o, len(self.lower)) for o in others)]
            return compose(operation, _calculated, operands)

    def _negative(self) -> ArrayValues:
        low = _unsigned(-self.upper)
        return ArrayValues(low, low if self.is_point else _unsigned(-self.lower), self.computed)

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
        return ArrayValues(lower, upper, np.where(m, mine, theirs))

    def gather(self, indices: Int32s | Int64s) -> ArrayValues:
        """The values at some states (repetitions allowed), as values of as many states."""
        lower = self.lower[indices]
        upper = lower if self.upper is self.lower else self.upper[indices]
        return ArrayValues(lower, upper, None if self.computed is None else self.computed[indices])


class Known(Protocol):
    """Values without an error, which have doubles near them."""

    def in_doubles(self) -> ArrayValues:
        """The nearest doubles; those that differ are marked as computed."""
        ...


def around(values: Floats) -> tuple[Floats, Floats]:
    """Bounds of values that are within ROUNDING of the true ones."""
    with np.errstate(invalid="ignore"):
        error = np.where(np.isfinite(values), ROUNDING * np.abs(values), 0.0)
    return values - error, values + error


def _operand(value: ArrayValues | Known | float | Fraction, n: int) -> ArrayValues:
    if isinstance(value, ArrayValues):
        return value
    if isinstance(value, int | float | Fraction):
        return _broadcast(value, n)
    return value.in_doubles()


def total_of(parts: Sequence[tuple[ArrayValues, int]]) -> tuple[float, float]:
    """Bounds of the sum of all values, each counted so many times; equal if they are ints."""
    lower = upper = size = 0.0
    whole = True
    for values, times in parts:
        low, high = times * _sum(values.lower), times * _sum(values.upper)
        whole = whole and values.is_point and np.array_equal(np.floor(values.lower), values.lower)
        lower, upper, size = lower + low, upper + high, size + max(abs(low), abs(high))
    finite = all(np.isfinite(v.lower).all() and np.isfinite(v.upper).all() for v, _ in parts)
    if finite and not (isfinite(lower) and isfinite(upper)):  # the sum is no double
        return min(lower, _LARGEST), max(upper, -_LARGEST)
    if not isfinite(size) or (whole and size <= LARGEST_WHOLE):
        return lower, upper
    error = (len(parts) + 4) * UNIT_ROUNDOFF * size + LEAST_NORMAL
    natural = all(np.all(v.lower >= 0) for v, _ in parts)
    return max(lower - error, 0.0 if natural else -_LARGEST), upper + error


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


_LARGEST = sys.float_info.max
_LIBRARY_UNITS = 8
"""Units in the last place by which C's powers and logarithms are wrong, at most."""


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
    points = x.is_point and y.is_point
    low, high = (
        (_POINTS[instruction](x.lower, y.lower),) * 2
        if points
        else _interval(instruction, (x.lower, x.upper), (y.lower, y.upper))
    )
    known = (x.lower == x.upper) & (y.lower == y.upper)
    rounded = _rounded(instruction, x.lower, y.lower, low)
    computed = _any((x.computed, y.computed, None if rounded is None else rounded & known))
    if not points and computed is not None:
        computed = computed & ~(x._between | y._between)
    if rounded is not None:
        library = instruction in (Instruction.POWER, Instruction.LOGARITHM)
        units = _LIBRARY_UNITS if library else 1
        low, high = _outward(low, high, rounded & known, units)
    low, high = _same(_unsigned(low), _unsigned(high))
    tiny, large = _outside(instruction, x.lower, y.lower, low)
    also_tiny, also_large = _outside(instruction, x.upper, y.upper, high)
    tiny, large = tiny & also_tiny, large | also_large
    if tiny.any():  # below the least normal double
        error = np.where(tiny, LEAST_NORMAL, 0.0)
        low, high = low - error, high + error
    if large.any():  # finite, but no double
        largest = np.copysign(_LARGEST, low)
        low, high = (
            np.where(large, choose(bound, largest), bound)
            for choose, bound in ((np.minimum, low), (np.maximum, high))
        )
    if computed is not None:
        computed = computed & ~(tiny | large)
    return ArrayValues(low, high, computed)


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


def _broadcast(value: float | Fraction, n: int) -> ArrayValues:
    near = float(value)
    low, high = bracket(value)
    array = np.full(n, low)
    if low == high:
        return ArrayValues(array, array)
    return ArrayValues(array, np.full(n, high), None if isinf(near) else np.ones(n, bool))


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
    units = 1
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
            rounded, units = low != high, _LIBRARY_UNITS
        case Instruction.REMAINDER:
            low, high = _remainders(x, y)
            rounded = low != high
        case Instruction.LOGARITHM:
            low, high = _unless((y[0] <= 1) & (y[1] >= 1) & (y[0] != y[1]), low, high)
            units = _LIBRARY_UNITS
        case _:
            assert_never(instruction)
    return _outward(low, high, rounded, units)


def _unless(unknown: Bools, low: Floats, high: Floats) -> _Pair:
    """Bounds that are infinite where nothing is known."""
    return np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)


def _is_zero(x: _Pair) -> Bools:
    return np.asarray((x[0] == 0) & (x[1] == 0))


def _outward(low: Floats, high: Floats, rounded: Bools, units: int = 1) -> _Pair:
    """Wider by some units in the last place, where they were rounded."""
    for _ in range(units):
        low = np.where(rounded & (low < np.inf), np.nextafter(low, -np.inf), low)
        high = np.where(rounded & (high > -np.inf), np.nextafter(high, np.inf), high)
    return low, high


def _corners(instruction: Instruction, x: _Pair, y: _Pair) -> _Pair:
    """Extreme values at the corners, for what is monotone in each operand."""
    values = [_POINTS[instruction](a, b) for a in x for b in y]
    return np.minimum.reduce(values), np.maximum.reduce(values)


def _remainders(x: _Pair, y: _Pair) -> _Pair:
    point = (y[0] == y[1]) & (np.floor(x[0] / y[0]) == np.floor(x[1] / y[1])) & (y[0] > 0)
    high = np.where(_is_zero(y), np.nan, np.maximum(np.abs(y[0]), np.abs(y[1])))
    low = np.where(_is_zero(y), np.nan, np.minimum(2 * y[0], 0.0))
    return np.where(point, np.mod(x[0], y[0]), low), np.where(point, np.mod(x[1], y[0]), high)
