"""Matrices in any form: what they do with vectors, and those without rows with bounds."""

from __future__ import annotations

from typing import Protocol, Self

from symcheck.direction import Direction
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices import tuning
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Floats
from symcheck.matrices.weights import Expectation

__all__ = ["BoundStep", "Operator", "SweepOperator", "underflow_error"]


def underflow_error(divisor: Floats | None) -> float:
    """The absolute error of a row of products that underflow, divided by one of the numbers."""
    least = 1.0 if divisor is None else float(divisor.min(initial=1.0))
    return tuning.UNDERFLOW_MARGIN / least


@dataclass(frozen=True, slots=True)
class BoundStep:
    """The step x = opt(A x + constant) on lower bounds of its solution, or on upper bounds.

    Attributes:
        constant: float64[rows], not negative.
        direction: the best choice of a state; None for a chain.
        rounding_error: relative rounding error of a step; bounds are moved outwards by it.
        upper: whether the bounds are upper ones.
    """

    constant: Floats
    direction: Direction | None
    rounding_error: float
    upper: bool


class Operator(Expectation, Protocol):
    """A matrix in any form, whose rows can be scaled."""

    def divided(self, divisor: Numbers, /) -> Self:
        """The matrix with each row divided by a number."""
        ...


class SweepOperator(Operator, Protocol):
    """A matrix without rows, which also improves bounds (float64[n]) in place."""

    def sweep(self, x: Floats, step: BoundStep, /) -> None:
        """Improve bounds, float64[n], by some steps, in place."""
        ...
