"""Outcomes of a formula over the ranges of parameters: conditions, cases and boxes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from fractions import Fraction
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

from symcheck.errors import UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rational_functions import (
    FunctionField,
    Polynomial,
    RationalFunction,
    point_of,
)
from symcheck.numerics.bernstein import Box, sign_on

if TYPE_CHECKING:
    from symcheck.engines.explicit.strategy import Strategy

__all__ = ["Case", "Condition", "Extremum", "Point", "Regions", "ends_of", "volume"]

Point = Mapping[str, Fraction]


@dataclass(frozen=True, eq=False)
class Condition:
    """A product of polynomials has a sign: `p*q - 1 > 0`."""

    parts: tuple[Polynomial, ...]
    sign: int
    ring: FunctionField = field(repr=False)

    def __str__(self) -> str:
        product = str(self.parts[0])
        if len(self.parts) > 1:
            product = "*".join(f"({p})" for p in self.parts)
        return f"{product} {'>' if self.sign > 0 else '<' if self.sign < 0 else '='} 0"

    def holds(self, point: Point) -> bool:
        """Whether it holds at a point."""
        value = prod(RationalFunction(self.ring, p, ())(**point) for p in self.parts)
        return (value > 0) - (value < 0) == self.sign

    def proved(self, box: Box) -> bool:
        """Whether it holds everywhere inside a box; False if that is not known."""
        return sign_on(self.parts, self.ring, box) == self.sign


@dataclass(frozen=True)
class Case:
    """An outcome, and where it holds.

    Attributes:
        value: a function of the parameters, a truth value, or an infinite number.
        conditions: where all of them hold, and all probabilities are positive, so does the value;
            None: it holds in `boxes`.
        sample: the point at which it was found.
        boxes: where the conditions are proved.
        strategy: with the option `strategy`, that of an MDP.
    """

    value: Any
    conditions: tuple[Condition, ...] | None = field(repr=False)
    sample: Point = field(repr=False)
    boxes: tuple[Box, ...] = field(default=(), repr=False)
    strategy: Strategy | None = field(default=None, repr=False)

    def holds(self, point: Point) -> bool:
        """Whether it is known to hold at a point."""
        if self.conditions is not None:
            return all(c.holds(point) for c in self.conditions)
        return any(all(low <= point[n] <= high for n, (low, high) in b.items()) for b in self.boxes)

    def proved(self, box: Box) -> bool:
        """Whether its conditions hold everywhere inside a box; False if that is not known."""
        return all(c.proved(box) for c in self.conditions or ())

    def __str__(self) -> str:
        """The value."""
        if isinstance(self.value, tuple):
            return "[{},{}]".format(*self.value)
        return str(self.value).lower() if isinstance(self.value, bool) else str(self.value)

    def __call__(self, **point: Fraction | float | str) -> Any:
        """The value at a point, whether or not it is valid there."""
        found = tuple(
            v(**point) if isinstance(v, RationalFunction) else v for v in ends_of(self.value)
        )
        return found if isinstance(self.value, tuple) else found[0]


@dataclass(frozen=True)
class Regions:
    """The outcomes of a formula over the ranges of the parameters.

    Attributes:
        box: the ranges.
        well_defined: the conditions under which all probabilities (rates) are positive: every
            outcome holds only there. Those that hold in all of `box` are left out.
        cases: the outcomes, in the order in which they were found.
        empty: boxes without a point where all probabilities are positive.
        undecided: boxes for which no outcome is proved.
    """

    box: Box
    well_defined: tuple[Condition, ...]
    cases: tuple[Case, ...]
    empty: tuple[Box, ...] = field(default=(), repr=False)
    undecided: tuple[Box, ...] = field(default=(), repr=False)

    @property
    def share(self) -> float:
        """The share of the volume that is decided."""
        return float(1 - self.share_of(self.undecided))

    @property
    def firsts(self) -> tuple[Case, ...]:
        """The first case of each value."""
        first: dict[Any, Case] = {}
        for case in self.cases:
            first.setdefault(case.value, case)
        return tuple(first.values())

    def where(self, value: object) -> tuple[Box, ...]:
        """The boxes in which the formula has a value."""
        return tuple(b for c in self.cases if c.value == value for b in c.boxes)

    @property
    def outcomes(self) -> tuple[tuple[str, tuple[Box, ...]], ...]:
        """The text of each outcome with its boxes; `no model` and `undecided` if there are any."""
        rest = ("no model", self.empty), ("undecided", self.undecided)
        cases = ((str(case), self.where(case.value)) for case in self.firsts)
        return (*cases, *(entry for entry in rest if entry[1]))

    def at(self, **point: Fraction | float | str) -> Case:
        """The case whose conditions hold at a point. Raises UsageError if there is none."""
        exact = point_of(self.box, point)
        if outside := [n for n, (low, high) in self.box.items() if not low < exact[n] < high]:
            ranges = ", ".join(f"{n}={low}:{high}" for n, (low, high) in self.box.items())
            raise UsageError(f"{', '.join(outside)} is not within the open ranges {ranges}")
        if all(c.holds(exact) for c in self.well_defined):
            for case in self.cases:
                if case.holds(exact):
                    return case
        raise UsageError(f"no case is known at {_shown(exact)}")

    def share_of(self, boxes: Iterable[Box]) -> Fraction:
        """The share of the volume that some boxes have."""
        return sum(map(volume, boxes), Fraction(0)) / volume(self.box)

    def _lines(self) -> Iterator[tuple[Fraction, str, str]]:
        """The share, the outcome and a remark of each value, and of what has none."""
        for case in self.firsts:
            where = f", first found at {_shown(case.sample)}"
            yield self.share_of(self.where(case.value)), str(case), where
        if self.empty:
            yield self.share_of(self.empty), "no model", ": a probability is negative or 0"
        if self.undecided:
            yield self.share_of(self.undecided), "undecided", ""

    @property
    def summary(self) -> str:
        """The outcomes with their shares of the volume, on one line."""
        return "; ".join(f"{float(share):.2%} {outcome}" for share, outcome, _ in self._lines())

    def __str__(self) -> str:
        lines = self._lines()
        return "\n".join(
            f"  {float(share):7.2%}  {outcome}{more}" for share, outcome, more in lines
        )


class Extremum(NamedTuple):
    """The value at a point, and a proved bound of the values at all points."""

    value: Fraction
    bound: Fraction
    point: Point


def ends_of(value: Any) -> tuple[Any, ...]:
    """The ends of a range of values over initial states; else the value."""
    return value if isinstance(value, tuple) else (value,)


def volume(box: Box) -> Fraction:
    """The product of the lengths of a box."""
    return prod((high - low for low, high in box.values()), start=Fraction(1))


def _shown(point: Point) -> str:
    return ", ".join(f"{n}={float(v):g}" for n, v in point.items())
