"""The Bellman operator of a linear problem, for methods that only multiply by the matrix."""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.operators import BoundStep
from symcheck.matrices.rows import Floats, Int64s, best_of_rows, first_best, per_row
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Progress,
    Solution,
    largest_width,
)
from symcheck.numerics.settings import Settings
from symcheck.parallel.threads import helpers, thread_count

__all__ = ["BellmanOperator", "iterate_bounds"]


@dataclass(frozen=True, eq=False)
class BellmanOperator:
    """x → opt(A x + b), on vectors of one value per state (float64[n]).

    rounding_error: bound on the relative error of one application to non-negative values.
    """

    problem: LinearProblem
    rounding_error: float

    @staticmethod
    def of(problem: LinearProblem) -> BellmanOperator:
        """The Bellman operator of a problem."""
        longest = problem.expectation.longest
        return BellmanOperator(problem, (longest + 8) * tuning.UNIT_ROUNDOFF + problem.error)

    def product(self, x: Floats) -> Floats:
        """A x, per row."""
        return self.problem.expectation.multiply(x)

    def best(self, rows: Floats) -> Floats:
        """The optimum over the rows of each state."""
        p = self.problem
        return best_of_rows(rows, p.choices, p.direction, p.opponents)

    def apply(self, x: Floats) -> Floats:
        """One application, rounded to nearest."""
        return self.best(self.product(x) + self.problem.constant)

    def apply_upwards(self, x: Floats) -> Floats:
        """One application to upper bounds, rounded up."""
        out = self.best(self.product(x) + self.problem.high) * (1.0 + self.rounding_error)
        positive = out > 0.0
        if not positive.all():  # a product may have underflowed to 0
            positive = self.best(self.product(np.sign(x)) + self.problem.high) > 0.0
        return np.where(positive, out + UNDERFLOW_MARGIN, 0.0)

    def improve_lower(self, lower: Floats) -> Floats:
        """Better lower bounds: one application, or a sweep if the matrix is an operator."""
        if self.problem.operator is None:
            improved = self.apply(lower) * (1.0 - self.rounding_error)
            return np.maximum(lower, improved - UNDERFLOW_MARGIN)
        return self._sweep(lower, self.problem.constant, upper=False)

    def improve_upper(self, upper: Floats) -> Floats:
        """Better upper bounds, likewise. The argument must be known to be an upper bound."""
        if self.problem.operator is None:
            return np.minimum(upper, self.apply_upwards(upper))
        return self._sweep(upper, self.problem.high, upper=True)

    def _sweep(self, bounds: Floats, constant: Floats, *, upper: bool) -> Floats:
        """A copy of the bounds after a sweep of the operator, which uses new values at once."""
        operator, out = self.problem.operator, bounds.copy()
        assert operator is not None
        operator.sweep(out, BoundStep(constant, self.problem.direction, self.rounding_error, upper))
        return out

    def improve_both(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        """Better lower and upper bounds; large sweeps run side by side in two threads."""
        if (
            len(lower) < tuning.TWO_THREADS_STATES
            or self.problem.operator is None
            or thread_count() == 1
        ):
            return self.improve_lower(lower), self.improve_upper(upper)
        other = helpers().submit(self.improve_lower, lower)
        improved = self.improve_upper(upper)
        return other.result(), improved

    def greedy_policy(self, x: Floats) -> Int64s | None:
        """The first optimal row of each state for the values x; None without choices."""
        groups = self.problem.choices
        if groups is None:
            return None
        rows = self.product(x) + self.problem.constant
        if self.problem.opponents is not None:
            return first_best(
                rows * per_row(groups, np.where(self.problem.maximises, 1, -1)), groups
            )
        return first_best(rows if self.problem.direction == Direction.MAX else -rows, groups)


def iterate_bounds(
    name: str,
    bellman: BellmanOperator,
    lower: Floats,
    upper: Floats,
    count: int,
    settings: Settings,
    observer: Observer | None,
) -> Solution:
    """Improve bounds until they have the requested width; `count` iterations were made before."""
    problem = bellman.problem
    width = largest_width(lower, upper, settings.relative)
    while settings.epsilon < width < np.inf and count < settings.max_iterations:
        before = lower, upper
        lower, upper = bellman.improve_both(lower, upper)
        width = largest_width(lower, upper, settings.relative)
        count += 1
        if observer is not None:
            observer(Progress(name, count, width, problem.n, lower, upper))
        if (
            count % tuning.STALL_CHECK_INTERVAL == 0
            and np.array_equal(lower, before[0])
            and np.array_equal(upper, before[1])
        ):
            break  # rounding prevents closer bounds
    if problem.probability:
        upper = np.minimum(upper, 1.0)
    note = f"{problem.n} states: {name}, {count} iterations"
    note += "" if width <= settings.epsilon else ", accuracy not reached"
    policy = bellman.greedy_policy(lower if problem.direction == Direction.MAX else upper)
    return Solution(lower, upper, name, False, True, count, note, policy)
