"""Checking of models with parameters: the ranges are divided into boxes, each with one outcome.

A formula is checked at a sample point over rational functions. The comparisons that were made on
the way are the conditions under which the outcome (a function, or a truth value) is the same; they
are proved for a box, or the box is split. One outcome usually serves many boxes.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from fractions import Fraction
from itertools import count
from math import inf, prod
from random import Random
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

from symcheck.check.checker import check
from symcheck.check.result import Exact, Result
from symcheck.direction import Direction
from symcheck.engines.base import Engine
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.parametric.build import ParametricModel, random_point
from symcheck.errors import NumericalError, UnsupportedError, UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rational_functions import FunctionField, Polynomial, RationalFunction
from symcheck.numerics.bernstein import Box, function_bounds, sign_on
from symcheck.options import Options
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.query import PathProbability, ReachReward, query_of
from symcheck.syntax.ast import Expression, Measure
from symcheck.syntax.declarations import Property

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symcheck.engines.explicit.strategy import Strategy

__all__ = ["Case", "Condition", "Extremum", "Regions", "Search", "check_parametric"]

_MOST_BOXES = 4000
"""Boxes after which an undecided rest is left."""
_SAMPLES = 40
"""Points at which a box is searched for one where all probabilities are positive."""

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

    def __call__(self, **point: Fraction | float | str) -> Any:
        """The value at a point, whether or not it is valid there."""
        return self.value(**point) if isinstance(self.value, RationalFunction) else self.value


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
        return float(1 - sum(map(volume, self.undecided), Fraction(0)) / volume(self.box))

    def where(self, value: object) -> tuple[Box, ...]:
        """The boxes in which the formula has a value."""
        return tuple(b for c in self.cases if c.value == value for b in c.boxes)

    def at(self, **point: Fraction | float | str) -> Case:
        """The case whose conditions hold at a point. Raises UsageError if there is none."""
        exact = {n: Fraction(str(v)) for n, v in point.items()}
        if all(c.holds(exact) for c in self.well_defined):
            for case in self.cases:
                if case.holds(exact):
                    return case
        raise UsageError(f"no case is known at {_shown(exact)}")

    def plot(self, axes: Axes | None = None) -> Axes:
        """The boxes of one or two parameters, by matplotlib (see `symcheck.view.parameters`)."""
        from symcheck.view.parameters import plot_regions

        return plot_regions(self, axes)

    def __str__(self) -> str:
        lines = []
        first: dict[str, Case] = {}
        for case in self.cases:
            first.setdefault(str(case.value).lower(), case)
        for text, case in first.items():
            share = sum(map(volume, self.where(case.value)), Fraction(0)) / volume(self.box)
            lines.append(f"  {float(share):7.2%}  {text}, first found at {_shown(case.sample)}")
        if self.empty:
            share = sum(map(volume, self.empty), Fraction(0)) / volume(self.box)
            lines.append(f"  {float(share):7.2%}  no model: a probability is negative or 0")
        if self.undecided:
            lines.append(f"  {1 - self.share:7.2%}  undecided")
        return "\n".join(lines)


class Extremum(NamedTuple):
    """The value at a point, and a proved bound of the values at all points."""

    value: Fraction
    bound: Fraction
    point: Point


def volume(box: Box) -> Fraction:
    """The product of the lengths of a box."""
    return prod((high - low for low, high in box.values()), start=Fraction(1))


def _shown(point: Point) -> str:
    return ", ".join(f"{n}={float(v):g}" for n, v in point.items())


def halves(box: Box, whole: Box) -> tuple[Box, Box]:
    """A box divided across its longest side, relative to the whole one."""

    def length(name: str) -> Fraction:
        (low, high), (first, last) = box[name], whole[name]
        return (high - low) / (last - first)

    name = max(box, key=length)
    low, high = box[name]
    middle = (low + high) / 2
    return {**box, name: (low, middle)}, {**box, name: (middle, high)}


class Search:
    """Divides the ranges of a model's parameters by the outcomes of a formula."""

    def __init__(
        self,
        engine: Engine,
        formula: Expression,
        options: Options,
        labels: Mapping[str, Expression] | None,
    ) -> None:
        explicit = engine.capability(ExplicitEngine)
        assert explicit is not None
        assert isinstance(explicit.explored, ParametricModel)
        self.engine, self.formula, self.options, self.labels = engine, formula, options, labels
        self.model = explicit.explored
        self.field = self.model.field
        self.box: Box = dict(self.model.model.parameters)
        self.random = Random(0)
        self.field.sample(random_point(self.model.model, self.random))
        for weight in self.model.weights:
            self.field.note([weight.top, *self._odd(weight)], 1)
        self.positive = self._conditions(set())
        self.cases: list[Case] = []
        self.boxes: list[list[Box]] = []
        self.result: Result | None = None
        self.lifting = options.lifting

    def _odd(self, function: RationalFunction) -> Iterator[Polynomial]:
        return (self.field.factors[i] for i, n in function.bottom if n % 2)

    def _conditions(self, known: set[str]) -> tuple[Condition, ...]:
        """The conditions that were noted, without those that are known."""
        noted = self.field.conditions.items()
        return tuple(Condition(p, s, self.field) for k, (p, s) in noted if k not in known)

    def sample(self, box: Box) -> Point | None:
        """A point inside a box where all probabilities are positive; None if none was found."""
        for _ in range(_SAMPLES):
            point = {
                n: low + (high - low) * Fraction(self.random.randrange(1, 1024), 1024)
                for n, (low, high) in box.items()
            }
            if all(c.holds(point) for c in self.positive):
                return point
        return None

    def case(self, point: Point) -> int:
        """The number of the case whose conditions hold at a point, which may be new."""
        for i, case in enumerate(self.cases):
            if case.holds(point):
                return i
        self.field.sample(point)
        result = check(self.engine, self.formula, self.options, labels=self.labels)
        if self.result is None:
            self.result = result
        known = {" * ".join(map(str, c.parts)) for c in self.positive}
        (strategy,) = result.strategies or (None,)
        self.cases.append(Case(result.value, self._conditions(known), point, (), strategy))
        self.boxes.append([])
        return len(self.cases) - 1

    def lifted(self, box: Box) -> tuple[Fraction, Fraction]:
        """Bounds of the value of the measure over a box, by parameter lifting.

        Raises UnsupportedError: bounds of this measure do not follow from those of its equations.
        """
        measure = self.formula
        if not isinstance(measure, Measure):
            raise UnsupportedError("parameter lifting bounds P and R alone")
        query = query_of(measure, self.model.model)
        match query.quantity:
            case PathProbability(UntilPath(negative=False)) | ReachReward():
                pass
            case _:
                raise UnsupportedError(
                    "parameter lifting bounds P [ F … ], P [ … U … ] and R [ F … ]"
                )
        direction = query.direction and query.direction.value
        asked = replace(measure, bound=None, direction=direction)
        found: list[Any] = []
        try:
            for self.field.lifting in ((box, Direction.MIN), (box, Direction.MAX)):
                self.result = check(self.engine, asked, self.options, labels=self.labels)
                found.append(self.result.value)
        finally:
            self.field.lifting = None
        if any(isinstance(value, RationalFunction) for value in found):
            raise UnsupportedError("parameter lifting has no bounds on steps")
        return found[0], found[1]

    def by_lifting(self, box: Box) -> bool:
        """Whether a box is decided by lifting; then it belongs to a case."""
        threshold = None
        if isinstance(self.formula, Measure):
            threshold = query_of(self.formula, self.model.model).threshold
        if threshold is None:
            raise UnsupportedError("parameter lifting decides P and R with a threshold")
        point = self.sample(box)
        if point is None or any(not c.proved(box) for c in self.positive):
            return False
        self.field.sample(point)
        values = {threshold.operator.compare(v, threshold.value) for v in self.lifted(box)}
        if len(values) == 2:
            return False
        (value,) = values
        if value not in (known := [c.value for c in self.cases]):
            self.cases.append(Case(value, None, point))
            self.boxes.append([])
        self.boxes[[*known, value].index(value)].append(box)
        return True

    def bounds(self, case: Case, box: Box) -> tuple[Fraction, Fraction] | None:
        """Bounds of the values over a box, where a case holds somewhere; None if not known."""
        if all(c.proved(box) for c in case.conditions or ()):
            function = case.value
            if not isinstance(function, RationalFunction):
                function = self.field.constant(function)
            return function_bounds(function, box)
        try:
            return self.lifted(box)
        except (NumericalError, UnsupportedError):
            return None

    def extremum(self, direction: Direction, gap: Fraction) -> Extremum:
        """A least or greatest value over the box, by branch and bound.

        Raises NumericalError: the bounds do not come close.
        """
        sign = 1 if direction is Direction.MIN else -1
        number = count()
        queue: list[tuple[Fraction | float, int, Box]] = [(-inf, next(number), self.box)]
        best: tuple[Fraction, Point] | None = None
        for _ in range(_MOST_BOXES):
            least, _, box = heapq.heappop(queue)
            if best is not None and best[0] - least <= gap:
                return Extremum(sign * best[0], sign * Fraction(least), best[1])
            for half in halves(box, self.box):
                point = self.sample(half)
                bound: Fraction | float = -inf
                if point is not None:
                    case = self.cases[self.case(point)]
                    value = sign * case(**point)
                    if best is None or value < best[0]:
                        best = value, point
                    if (bounds := self.bounds(case, half)) is not None:
                        bound = min(sign * b for b in bounds)
                heapq.heappush(queue, (bound, next(number), half))
        raise NumericalError(f"the bounds are not within {float(gap):g} after {_MOST_BOXES} boxes")

    def regions(self, share: float, *, feasible: bool = False) -> Regions:
        """Divide the box until a share of its volume is decided, or one value is true."""
        whole, number = volume(self.box), count()
        rest = (1 - Fraction(repr(share))) * whole
        queue: list[tuple[Fraction, int, Box, frozenset[Condition]]] = []
        heapq.heappush(queue, (-whole, next(number), self.box, frozenset()))
        left, empty = whole, []
        for _ in range(_MOST_BOXES):
            found = feasible and any(c.value is True for c in self.cases)
            if found or not queue or left <= rest:
                break
            negative, _, box, proved = heapq.heappop(queue)
            point = self.sample(box)
            if self.lifting and point is not None:
                done = self.by_lifting(box)
            elif point is None:
                done = any(
                    Condition(c.parts, -c.sign, self.field).proved(box) for c in self.positive
                )
                if done:
                    empty.append(box)
            else:
                chosen = self.case(point)
                conditions = self.cases[chosen].conditions or ()
                proved |= {c for c in conditions if c not in proved and c.proved(box)}
                done = proved.issuperset(conditions)
                if done:
                    self.boxes[chosen].append(box)
            if done:
                left += negative
                continue
            for half in halves(box, self.box):
                heapq.heappush(queue, (negative / 2, next(number), half, proved))
        if not self.cases:
            raise NumericalError(
                "at no point of the ranges that was tried are all probabilities positive",
                hint="give ranges in which the probabilities lie between 0 and 1",
            )
        return Regions(
            self.box,
            tuple(c for c in self.positive if not c.proved(self.box)),
            tuple(replace(c, boxes=tuple(b)) for c, b in zip(self.cases, self.boxes, strict=True)),
            tuple(empty),
            tuple(box for _, _, box, _ in queue) if left else (),
        )


def check_parametric(
    engine: Engine,
    formula: Expression | Property,
    options: Options | None = None,
    *,
    labels: Mapping[str, Expression] | None = None,
) -> Result:
    """Check a bound formula on a model with parameters.

    Returns:
        A result whose `regions` have the outcomes; its value is that of all of them, None if they
        differ.

    Raises:
        SymcheckError: see `symcheck.check.checker.check`.
        NumericalError: no point was found at which all probabilities are positive.
    """
    started = perf_counter()
    if isinstance(formula, Property):
        formula = formula.formula
    options = options or Options()
    search = Search(engine, formula, options, labels)
    regions = search.regions(options.regions)
    assert search.result is not None
    first, *others = regions.cases
    same = all(other.value == first.value for other in others)
    where = [str(c) for c in regions.well_defined]
    explanation = search.result.explanation
    if not same:
        explanation = f"{len(regions.cases)} cases"
    if regions.undecided:
        explanation += f"; {regions.share:.2%} of the volume are decided"
    if where:
        explanation += f"; where {', '.join(where)}"
    return replace(
        search.result,
        value=first.value
        if same and not (regions.undecided and isinstance(first.value, bool))
        else None,
        accuracy=Exact(),
        explanation=explanation,
        values_or_none=None,
        satisfying_or_none=None,
        strategies=(first.strategy,) if same and first.strategy is not None else (),
        regions=regions,
        seconds=perf_counter() - started,
        explain=None,
        certify=None,
    )
