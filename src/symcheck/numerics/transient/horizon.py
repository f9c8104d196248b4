"""Values of a CTMC at a time: what is asked for, and the bounds that answer it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer, largest_width
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.uniformized_chain import UniformizedChain, uniformize

__all__ = ["Horizon", "Transient", "close_enough"]


@dataclass(frozen=True, eq=False)
class Transient:
    """Certified bounds, float64[n] each, the number of steps, and one line for users."""

    lower: Floats
    upper: Floats
    iterations: int
    explanation: str

    @property
    def middle(self) -> Floats:
        """The midpoint of the bounds."""
        return 0.5 * (self.lower + self.upper)

    def widened(self, error: float) -> Transient:
        """The bounds, widened by an absolute error: relative ones do not hold near underflow."""
        return replace(self, lower=np.maximum(self.lower - error, 0.0), upper=self.upper + error)

    def plus(self, other: Transient) -> Transient:
        """The sum of two parts, rounded outwards."""
        lower, upper = (
            (self.lower + other.lower) * (1 - 2 * tuning.UNIT_ROUNDOFF),
            (self.upper + other.upper) * (1 + 2 * tuning.UNIT_ROUNDOFF),
        )
        return Transient(
            lower,
            upper,
            self.iterations + other.iterations,
            f"{self.explanation}; {other.explanation}",
        )


@dataclass(frozen=True, eq=False)
class Horizon:
    """Values at a time, which need the accuracy at some states.

    Attributes:
        rates, exit_rates, time, settings, interest, observer, leave, limit, error, trimmed: as in
            `symcheck.numerics.transient.values.transient_values`.
    """

    rates: SparseMatrix | SweepOperator
    exit_rates: Floats
    time: float
    settings: Settings
    interest: Int64s | None
    observer: Observer | None
    leave: Floats | None = None
    limit: Callable[[], Floats] | None = None
    error: float = 0.0
    trimmed: bool = False

    @cached_property
    def steps(self) -> float:
        """The expected number of steps of uniformisation."""
        return float(self.exit_rates.max(initial=0.0)) * self.time

    @cached_property
    def chain(self) -> UniformizedChain:
        """The uniformised chain."""
        return uniformize(self.rates, self.exit_rates, error=self.error)


def close_enough(below: Floats, above: Floats, settings: Settings) -> bool:
    """Whether bounds are as close as requested."""
    return largest_width(below, above, settings.relative) <= settings.epsilon
