"""What algorithms ask of the weights of transitions, and no more.

Elimination asks for a field: sums, products, quotients and a test for zero. Policy iteration also
compares its elements. Iteration asks for the expectation of each row, and compares expectations.
Doubles and rationals are all of these; a type that lacks one, as rational functions lack an order
and intervals a quotient, cannot be passed to an algorithm that needs it.
"""

from __future__ import annotations

from typing import Protocol, Self, TypeVar

from symcheck.matrices.numbers import Numbers

__all__ = ["Expectation", "F", "FieldElement", "O", "OrderedElement"]


class FieldElement(Protocol):
    """A number with the four operations; `not x` tests for zero. Ints are elements too."""

    def __bool__(self) -> bool: ...
    def __add__(self, other: Self | int, /) -> Self: ...
    def __radd__(self, other: int, /) -> Self: ...
    def __rsub__(self, other: int, /) -> Self: ...
    def __mul__(self, other: Self | int, /) -> Self: ...
    def __truediv__(self, other: Self | int, /) -> Self: ...


class OrderedElement(FieldElement, Protocol):
    """An element of an ordered field."""

    def __sub__(self, other: Self | int, /) -> Self: ...
    def __rmul__(self, other: int, /) -> Self: ...
    def __gt__(self, other: int, /) -> bool: ...


F = TypeVar("F", bound=FieldElement)
O = TypeVar("O", bound=OrderedElement)  # noqa: E741 (as F for a field)


class Expectation(Protocol):
    """The rows of a matrix in any form, as distributions over states."""

    @property
    def longest(self) -> int:
        """The largest number of entries of a row, or more; it bounds the rounding of sums."""
        ...

    def multiply(self, x: Numbers, /) -> Numbers:
        """The expectation of x, a number per state, by each row."""
        ...
