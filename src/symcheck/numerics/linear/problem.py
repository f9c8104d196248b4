"""Linear problems x = A x + b over the states whose value is not known in advance, and their solutions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.kernels.rows import sparse
from symcheck.matrices.numbers import Numbers, is_exact, sum_segments
from symcheck.matrices.rows import Int64s, SparseMatrix

__all__ = ["LinearProblem", "Observer", "Operator", "Solution", "Step"]

_SLICE = 65536  # states


@dataclass(frozen=True, slots=True)
class Step:
    """What an observer is told: where a method is. `width`: what is left between the bounds, or the last change.

    lower, upper: the iterates, where the method has them at hand (`upper` only where it is a bound); end components are
    single states then. They belong to the method: look, do not write.
    """

    method: str
    iteration: int
    width: float
    states: int
    lower: Numbers | None = field(default=None, compare=False, repr=False)
    upper: Numbers | None = field(default=None, compare=False, repr=False)


Observer = Callable[[Step], None]


class Operator(Protocol):
    """A matrix that can only be multiplied: x (a value per state) → A x (a value per row)."""

    def multiply(self, x: Numbers, /) -> Numbers:
        """A x."""
        ...


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """x_s = opt over the rows r of s of (constant[r] + sum over t of A[r, t] x_t), least non-negative solution.

    Numbers are float64, or all of them rationals (see `symcheck.matrices.numbers`).
    matrix: probabilities among the n unknowns; its groups are the choices (None: one row per state). Either it or
    `operator` (with `groups`) must be given; methods that need rows need `matrix`.
    constant: b, per row; `upper` is its upper bound where it is not known exactly (None: equal to `constant`).
    exit: per row, the probability of leaving the unknowns, to wherever (target or not). Give it: 1 minus the row's sum,
      which replaces it, loses the digits of small probabilities and takes less than about 1e-15 for 0.
    direction: None (no choices), 'min' or 'max'.
    probability: True for reachability probabilities (0 <= x <= 1); False for rewards.

    What must have been removed by graph analysis before: states with value 0 or 1 (probabilities), states with infinite
    value (rewards: 'max': unless all strategies leave almost surely; 'min': unless some strategy does). End components
    are dealt with here. Negative rewards are allowed where all strategies leave almost surely.
    """

    constant: Numbers
    matrix: SparseMatrix | None = None
    upper: Numbers | None = None
    exit: Numbers | None = None
    direction: Direction | None = None
    probability: bool = True
    operator: Operator | None = None
    groups: Int64s | None = None

    @property
    def rows(self) -> SparseMatrix:
        """The matrix; NumericalError if there is only an operator."""
        if self.matrix is None:
            raise NumericalError(
                "this method needs the rows of the matrix, and the engine gives only products"
            )
        return self.matrix

    @property
    def n(self) -> int:
        """Number of unknowns."""
        if self.matrix is not None:
            return self.matrix.states
        return len(self.constant) if self.groups is None else len(self.groups) - 1

    @property
    def mode(self) -> int:
        """0 without choices, 1 for min, 2 for max (as the kernels say it)."""
        if self.choices is None:
            return 0
        return 2 if self.direction == Direction.MAX else 1

    @property
    def choices(self) -> Int64s | None:
        """Row groups, None where rows are states."""
        return self.matrix.groups if self.matrix is not None else self.groups

    @property
    def high(self) -> Numbers:
        """Upper bounds of the constants."""
        return self.constant if self.upper is None else self.upper

    @property
    def exact(self) -> bool:
        """Whether the numbers are rationals."""
        return is_exact(self.constant)

    @property
    def signed(self) -> bool:
        """True where some constant is negative."""
        return bool(len(self.constant)) and bool(self.constant.min() < 0.0)

    @cached_property
    def leaving(self) -> Numbers:
        """`exit`, or what stands for it: float64[rows]."""
        if self.exit is not None:
            out = np.asarray(self.exit)
        elif self.exact:
            out = 1 - sum_segments(self.rows.data, self.rows.indptr)
        elif self.matrix is not None:
            out = 1.0 - sparse.row_sums(self.matrix.indptr, self.matrix.data)
            noise = (np.diff(self.matrix.indptr) + 2) * 2.0**-52
            out[out <= noise] = 0.0
        else:
            out = np.zeros(len(self.constant))
        return (
            np.maximum(out, self.high)
            if self.probability and bool((out < self.high).any())
            else out
        )

    def with_constant(
        self, constant: Numbers, upper: Numbers | None = None, probability: bool | None = None
    ) -> LinearProblem:
        """The same equations with other constants."""
        kind = self.probability if probability is None else probability
        return replace(self, constant=constant, upper=upper, probability=kind, exit=self.leaving)


@dataclass(frozen=True, eq=False)
class Solution:
    """Bounds on the solution, float64[n] each (the same rationals twice where the problem has rationals).

    exact: they differ, from each other and from the truth, by rounding only: by less than ROUNDING. certified: proved to be
    bounds; else both are the same estimate. strategy: a row per state (-1: any) that attains `lower` ('max') or `upper`
    ('min'). explanation: a line on how it was found.
    """

    lower: Numbers
    upper: Numbers
    method: str
    exact: bool = False
    certified: bool = True
    iterations: int = 0
    explanation: str = ""
    statistics: Mapping[str, Any] = field(default_factory=dict)
    strategy: Int64s | None = None

    @property
    def middle(self) -> Numbers:
        """The point between the bounds."""
        if is_exact(self.lower):
            return self.lower
        out = np.empty(len(self.lower))
        with np.errstate(invalid="ignore"):
            for part in self._parts():
                low, high = self.lower[part], self.upper[part]
                out[part] = np.where(low == high, low, 0.5 * (low + high))
        return out

    def width(self, relative: bool = True) -> float:
        """The greatest width, relative to the upper bound unless that is below 1e-300 (0 for no states)."""
        if is_exact(self.lower):
            return 0.0
        return max(
            (_width(self.lower[part], self.upper[part], relative) for part in self._parts()),
            default=0.0,
        )

    def _parts(self) -> Iterator[slice]:
        """Slices that stay in a cache, where whole arrays of intermediate results would take the memory of several vectors."""
        return (slice(begin, begin + _SLICE) for begin in range(0, len(self.lower), _SLICE))


def _width(lower: Numbers, upper: Numbers, relative: bool) -> float:
    with np.errstate(invalid="ignore"):
        width = np.where(lower == upper, 0.0, upper - lower)
        if relative:
            width = width / np.maximum(np.maximum(np.abs(lower), np.abs(upper)), 1e-300)
    # Without an upper bound, the width has no number relative to it.
    width[np.isnan(width)] = np.inf
    return float(width.max())
