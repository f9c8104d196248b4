"""Linear problems x = opt(A x + b) over the states with unknown values, and their solutions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, is_rational, sum_segments
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix
from symcheck.matrices.weights import Expectation
from symcheck.numerics import tuning

__all__ = [
    "LinearProblem",
    "Observer",
    "Progress",
    "Solution",
    "largest_width",
]


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of an iterative method, as an observer receives it.

    width: the distance of the bounds, or the last change of an estimate.
    lower, upper: the iterates, if the method has them (`upper` only if it is a bound); an end
      component is a single state there. They belong to the method and must not be written to.
    policy: the row of each state that policy iteration evaluates; None for other methods.
    """

    method: str
    iteration: int
    width: float
    states: int
    lower: Numbers | None = field(default=None, compare=False, repr=False)
    upper: Numbers | None = field(default=None, compare=False, repr=False)
    policy: Int64s | None = field(default=None, compare=False, repr=False)


Observer = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """x_s = opt over the rows r of s of (constant[r] + sum over t of A[r, t] x_t).

    The least non-negative solution is wanted. Numbers are float64, or all of them rationals (see
    `symcheck.matrices.numbers`).

    constant: b, per row; `upper` is an upper bound of b if b is not known exactly (None: b is).
    matrix: probabilities among the n unknown states, whose groups are the choices (None: one row
      per state). Either it or `operator` (with `groups`) must be given; methods that need rows need
      `matrix`.
    exit: per row, the probability of leaving the unknown states, to the target or not. It should be
      given: the default, 1 minus the sum of the row, loses the digits of small probabilities and
      takes values below about 1e-15 for 0.
    direction: minimise or maximise over the choices; None without choices.
    opponents: the states that choose against the direction, bool[n]; None: it is no game.
    allow_stay: of a game, whether expected rewards are 0 where nothing is earned for ever; if not,
      the states have to be left.
    probability: True for reachability probabilities (0 <= x <= 1), False for rewards.
    error: of A, b and `exit`, relative: numbers of a text are rounded. constant_error: of b alone,
      beyond the former.

    Graph analysis must have removed states of value 0 or 1 (probabilities) and of infinite value
    (rewards: for 'max' unless all strategies leave almost surely, for 'min' unless some does). End
    components are dealt with by the methods. Negative rewards are allowed if all strategies leave
    almost surely.
    """

    constant: Numbers
    matrix: SparseMatrix | None = None
    upper: Numbers | None = None
    exit: Numbers | None = None
    direction: Direction | None = None
    probability: bool = True
    operator: SweepOperator | None = None
    groups: Int64s | None = None
    error: float = tuning.ENTRY_ERROR
    constant_error: float = 0.0
    opponents: Bools | None = None
    allow_stay: bool = False

    @property
    def maximises(self) -> Bools:
        """The states of a game in which the greatest value is chosen."""
        assert self.opponents is not None
        return self.opponents ^ (self.direction is Direction.MAX)

    @property
    def least(self) -> bool:
        """Whether the least solution of a game is wanted."""
        return self.probability or self.allow_stay

    @property
    def rows(self) -> SparseMatrix:
        """The matrix.

        Raises:
            NumericalError: there is only an operator.
        """
        if self.matrix is None:
            raise NumericalError(
                "this method needs the rows of the matrix, and the engine gives only products"
            )
        return self.matrix

    @property
    def expectation(self) -> Expectation:
        """The matrix in the form that is there."""
        return self.rows if self.operator is None else self.operator

    @property
    def n(self) -> int:
        """Number of unknown states."""
        if self.matrix is not None:
            return self.matrix.states
        return len(self.constant) if self.groups is None else len(self.groups) - 1

    @property
    def mode(self) -> int:
        """The kernels' code for the direction: 0 without choices, 1 for min, 2 for max."""
        if self.choices is None:
            return 0
        return 2 if self.direction == Direction.MAX else 1

    @property
    def choices(self) -> Int64s | None:
        """Row groups; None if rows are states."""
        return self.matrix.groups if self.matrix is not None else self.groups

    @property
    def high(self) -> Numbers:
        """Upper bounds of the constants."""
        return self.constant if self.upper is None else self.upper

    @property
    def is_rational(self) -> bool:
        """Whether the numbers are rationals."""
        return is_rational(self.constant)

    @property
    def signed(self) -> bool:
        """Whether some constant is negative."""
        return bool(len(self.constant)) and bool(self.constant.min() < 0.0)

    @cached_property
    def leaving(self) -> Numbers:
        """`exit`, or its default, per row."""
        if self.exit is not None:
            out = np.asarray(self.exit)
        elif self.is_rational:
            out = 1 - sum_segments(self.rows.data, self.rows.indptr)
        elif self.matrix is not None:
            out = 1.0 - self.matrix.row_sums()
            noise = (self.matrix.lengths + 2) * 2.0 * tuning.UNIT_ROUNDOFF
            out[out <= noise] = 0.0
        else:
            out = np.zeros(len(self.constant))
        return (
            np.maximum(out, self.high)
            if self.probability and bool((out < self.high).any())
            else out
        )

    def with_constant(self, constant: Numbers, upper: Numbers) -> LinearProblem:
        """The same equations with other constants and their upper bounds."""
        return replace(self, constant=constant, upper=upper, exit=self.leaving)


@dataclass(frozen=True, eq=False)
class Solution:
    """Bounds on the solution, float64[n] each (or the same rationals twice).

    up_to_rounding: the bounds differ from each other and from the solution by rounding only,
      relatively by less than ROUNDING.
    certified: the bounds are proved; otherwise both are the same estimate.
    strategy: a row per state (-1: any) that attains `lower` ('max') or `upper` ('min').
    explanation: one line on how the solution was found.
    """

    lower: Numbers
    upper: Numbers
    method: str
    up_to_rounding: bool = False
    certified: bool = True
    iterations: int = 0
    explanation: str = ""
    strategy: Int64s | None = None

    def widened(self, error: float) -> Solution:
        """The solution of equations without negative constants, whose relative error is this."""
        if error == 0.0 or is_rational(self.lower):
            return self
        return replace(self, lower=self.lower * (1.0 - error), upper=self.upper * (1.0 + error))

    @property
    def middle(self) -> Numbers:
        """The midpoint of the bounds."""
        if is_rational(self.lower):
            return self.lower
        out = np.empty(len(self.lower))
        with np.errstate(invalid="ignore"):
            for part in _slices(len(out)):
                low, high = self.lower[part], self.upper[part]
                out[part] = np.where(low == high, low, 0.5 * (low + high))
        return out

    def width(self, relative: bool = True) -> float:
        """The largest width (see `largest_width`)."""
        return largest_width(self.lower, self.upper, relative)


def largest_width(
    lower: Numbers, upper: Numbers, relative: bool, least: float = tuning.SMALLEST_DIVISOR
) -> float:
    """The largest width of bounds, relative to the larger absolute bound and to no less than
    `least`.

    0 without states, and for rationals, whose bounds are equal.
    """
    largest = 0.0
    if is_rational(lower):
        return largest
    for part in _slices(len(lower)):
        low, high = lower[part], upper[part]
        with np.errstate(invalid="ignore"):
            width = np.where(low == high, 0.0, high - low)
            if relative:
                width /= np.maximum(np.maximum(np.abs(low), np.abs(high)), least)
        # An infinite upper bound has no relative width.
        width[np.isnan(width)] = np.inf
        largest = max(largest, float(width.max()))
    return largest


def _slices(n: int) -> Iterator[slice]:
    """Slices of n states: temporary arrays of a slice are small and stay in the cache."""
    return (slice(at, at + tuning.STATES_PER_SLICE) for at in range(0, n, tuning.STATES_PER_SLICE))
