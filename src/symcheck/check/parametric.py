"""Checking of models with parameters: the ranges are divided into boxes, each with one outcome.

A formula is checked at a sample point over rational functions. The comparisons that were made on
the way are the conditions under which the outcome (a function, or a truth value) is the same; they
are proved for a box, or the box is split. One outcome usually serves many boxes.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from itertools import count
from math import inf
from numbers import Rational
from random import Random
from time import perf_counter
from typing import Any

from symcheck.check.checker import check
from symcheck.check.regions import Case, Condition, Extremum, Point, Regions, ends_of, volume
from symcheck.check.result import Exact, Result
from symcheck.direction import Direction
from symcheck.engines.base import Engine
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.parametric.build import ParametricModel, random_point
from symcheck.engines.parametric.corners import corners
from symcheck.engines.registry import build
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.numerics.bernstein import Box, function_bounds, sign_on
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.query import PathProbability, ReachReward, Threshold, query_of
from symcheck.syntax.ast import Expression, Measure
from symcheck.syntax.declarations import Property
from symcheck.syntax.traversal import conjuncts, nodes

__all__ = ["Search", "check_parametric"]

_MOST_BOXES = 4000
"""Boxes after which an undecided rest is left."""
_SAMPLES = 40
"""Points at which a box is searched for one where all probabilities are positive."""


def parts_of(box: Box, whole: Box) -> tuple[Box, Box, Box]:
    """A box divided across its longest side, relative to the whole one: halves, and their border.

    What is proved inside boxes says nothing about the border, which is a box without volume.
    """

    def length(name: str) -> Fraction:
        (low, high), (first, last) = box[name], whole[name]
        return (high - low) / (last - first)

    name = max(box, key=length)
    low, high = box[name]
    middle = (low + high) / 2
    sides = (low, middle), (middle, high), (middle, middle)
    first_half, second_half, border = ({**box, name: side} for side in sides)
    return first_half, second_half, border


class Search:
    """Divides the ranges of a model's parameters by the outcomes of a formula.

    On decision diagrams there are no functions: boxes are decided by the MDPs of their corners.
    """

    def __init__(
        self,
        engine: Engine,
        formula: Expression,
        options: Options,
        labels: Mapping[str, Expression] | None,
        model: BoundModel,
    ) -> None:
        """Search on an engine of functions, or of the corners of `model`, which has parameters."""
        self.engine, self.formula, self.options, self.labels = engine, formula, options, labels
        self.bound = model
        self.box: Box = dict(model.parameters)
        self.random = Random(0)
        self.positive: tuple[Condition, ...] = ()
        self.cases: list[Case] = []
        self.boxes: list[list[Box]] = []
        self.result: Result | None = None
        self.lifting, self.has_functions = options.lifting, True
        self.any_strategy_violates = False
        explicit = engine.capability(ExplicitEngine)
        if explicit is None or not isinstance(explicit.explored, ParametricModel):
            self.field = FunctionField(list(self.box))
            self.lifting, self.has_functions = True, False
            self._check_lifted()
            return
        found = explicit.explored
        self.field = found.field
        self.field.sample(random_point(self.box, self.random))
        for weight in found.weights:
            self.field.note(weight.sign_parts, 1)
        rewards = (*found.state_rewards, *found.choice_rewards)
        for bottom in {f.bottom for array in rewards for f in array.tolist() if f.bottom}:
            poles = [self.field.factors[i] for i, _ in bottom]
            self.field.note([*poles, *poles], 1)  # a square: the denominator is not 0
        self.positive = self._conditions()

    def _conditions(self) -> tuple[Condition, ...]:
        """The conditions that were noted, without those that are known."""
        noted = self.field.conditions.values()
        known = [c.parts for c in self.positive]
        return tuple(Condition(p, s, self.field) for p, s in noted if p not in known)

    @property
    def is_nested(self) -> bool:
        """Whether the formula has several operators."""
        return sum(isinstance(node, Measure) for node in nodes(self.formula)) > 1

    def sample(self, box: Box) -> Point | None:
        """A point inside a box where all probabilities are positive; None if none was found."""
        for _ in range(_SAMPLES):
            point = random_point(box, self.random)
            if all(c.holds(point) for c in self.positive):
                return point
        return None

    def is_empty(self, box: Box) -> bool:
        """Whether it is proved that some probability is not positive anywhere in a box."""
        signs = ((sign_on(c.parts, self.field, box), c.sign) for c in self.positive)
        return any(found in (0, -sign) for found, sign in signs)

    @property
    def has_one_value(self) -> bool:
        """Whether all cases that are known have the same value."""
        return all(c.value == self.cases[0].value for c in self.cases)

    def case(self, point: Point) -> int | None:
        """The number of the case whose conditions hold at a point, which may be new.

        None: the formula divides by 0 there.
        """
        for i, case in enumerate(self.cases):
            if case.holds(point):
                return i
        self.field.sample(point)
        try:
            result = check(self.engine, self.formula, self.options, labels=self.labels)
        except ZeroDivisionError:
            return None
        if self.result is None:
            self.result = result
        (strategy,) = result.strategies or (None,)
        self.cases.append(Case(result.value, self._conditions(), point, (), strategy))
        self.boxes.append([])
        return len(self.cases) - 1

    def lifted(self, box: Box) -> tuple[Fraction, Fraction]:
        """Bounds of the value of the measure over a box, by parameter lifting.

        Raises:
            UnsupportedError: bounds of this measure do not follow from those of its equations.
            NumericalError: there are none over this box.
        """
        measure = self.formula
        if not isinstance(measure, Measure):
            raise UnsupportedError("parameter lifting bounds P and R alone")
        if self.is_nested:
            raise UnsupportedError(
                "parameter lifting has no nested operators: bounds of one do not bound the other",
                hint="without -lifting, regions are decided by functions",
            )
        query = query_of(measure, self.bound)
        match query.quantity:
            case PathProbability(UntilPath()) | ReachReward():
                pass
            case _:
                raise UnsupportedError(
                    "parameter lifting bounds P [ F … ], P [ G … ], P [ … U … ] and R [ F … ]"
                )
        direction = query.direction and query.direction.value
        asked = replace(measure, bound=None, direction=direction)
        found: list[Any] = []
        if not self.has_functions:
            engine = build(corners(self.bound, box), self.options)
            for i, side in enumerate(("min", "max")):
                end = replace(asked, direction=side)
                self.result = check(engine, end, self.options, labels=self.labels)
                found.append(self.result.bounds[i])
            return found[0], found[1]
        if not all(c.proved(box) for c in self.positive):
            raise NumericalError("probabilities are not known to be positive")
        try:
            for self.field.lifting in ((box, Direction.MIN), (box, Direction.MAX)):
                self.result = check(self.engine, asked, self.options, labels=self.labels)
                found.append(self.result.value)
        except ZeroDivisionError:
            raise NumericalError("a denominator is 0 on the border of the box") from None
        finally:
            self.field.lifting = None
        if any(isinstance(value, RationalFunction) for value in found):
            raise UnsupportedError("parameter lifting has no bounds on steps")
        return min(found), max(found)  # a complement exchanges them

    def _check_lifted(self) -> None:
        """Raises UnsupportedError if bounds stay apart, or what is asked for is a function."""
        if self.threshold is None:
            raise UnsupportedError(
                "decision diagrams have no functions of parameters: they decide P and R with a "
                "threshold",
                hint="without -m, -h and -s, there are functions",
            )
        point = random_point(self.box, self.random)
        chain = build(corners(self.bound, {n: (v, v) for n, v in point.items()}), self.options)
        if chain.choices > chain.states:
            raise UnsupportedError(
                "several commands are enabled in a state, and parameter lifting on decision "
                "diagrams would choose among them",
                hint="without -m, -h and -s, a fair coin decides",
            )

    @property
    def threshold(self) -> Threshold | None:
        """That of a formula P, R or S with a bound; None of another formula."""
        if not isinstance(self.formula, Measure):
            return None
        return query_of(self.formula, self.bound).threshold

    def decided(self, box: Box, point: Point, threshold: Threshold) -> bool | None:
        """The verdict that lifting proves for all of a box with a point; None if it proves none."""
        self.field.sample(point)
        try:
            bounds = self.lifted(box)
        except NumericalError:
            return None
        verdicts = {_all_admitted(threshold, bound) for bound in bounds}
        return verdicts.pop() if len(verdicts) == 1 else None

    def by_lifting(self, box: Box, point: Point) -> bool:
        """Whether a box with a point is decided by lifting; then it belongs to a case."""
        if (threshold := self.threshold) is None:
            raise UnsupportedError("parameter lifting decides P and R with a threshold")
        if (value := self.decided(box, point, threshold)) is None:
            return False
        if value not in (known := [c.value for c in self.cases]):
            self.cases.append(Case(value, None, point))
            self.boxes.append([])
        self.boxes[[*known, value].index(value)].append(box)
        return True

    def bounds(self, case: Case, box: Box) -> tuple[Fraction, Fraction] | None:
        """Bounds of the values over a box, where a case holds somewhere; None if not known."""
        if case.proved(box):
            function = case.value
            if not isinstance(function, RationalFunction):
                function = self.field.constant(function)
            return function_bounds(function, box)
        try:
            return self.lifted(box)
        except (NumericalError, UnsupportedError):
            return None

    def parts(self, box: Box) -> Iterator[tuple[Box, Point | None]]:
        """The parts of a box that are not proved to be empty, each with a point if one is found."""
        for part in parts_of(box, self.box):
            point = self.sample(part)
            if point is not None or not self.is_empty(part):
                yield part, point

    def extremum(self, direction: Direction, gap: Fraction) -> Extremum:
        """A least or greatest value over the box, by branch and bound.

        Raises:
            NumericalError: the bounds do not come close.
            UnsupportedError: the formula has no number as its value everywhere.
        """
        if not self.has_functions:
            raise UnsupportedError(
                "decision diagrams have no extremal values of parameters",
                hint="engine='auto' has them",
            )
        sign = 1 if direction is Direction.MIN else -1
        number = count()
        queue: list[tuple[Fraction | float, int, Box]] = [(-inf, next(number), self.box)]
        best: tuple[Fraction, Point] | None = None
        for _ in range(_MOST_BOXES):
            if not queue:
                break
            least, _, box = heapq.heappop(queue)
            if best is not None and best[0] - least <= gap:
                return Extremum(sign * best[0], sign * Fraction(least), best[1])
            for part, point in self.parts(box):
                bound: Fraction | float = -inf
                chosen = None if point is None else self.case(point)
                if chosen is None and is_point(part):
                    continue  # where the formula divides by 0
                if point is not None and chosen is not None:
                    case = self.cases[chosen]
                    _check_number(case)
                    with suppress(ZeroDivisionError):
                        value = sign * case(**point)
                        if best is None or value < best[0]:
                            best = value, point
                        if (bounds := self.bounds(case, part)) is not None:
                            bound = min(sign * b for b in bounds)
                heapq.heappush(queue, (bound, next(number), part))
        raise NumericalError(f"the bounds are not within {float(gap):g} after {_MOST_BOXES} boxes")

    def feasible(self) -> Point | None:
        """A point at which the formula holds; None if it is proved that it holds at none.

        A box is left out where one conjunct is refuted. By turns, the newest box is divided, which
        leads to where the formula almost holds, and the oldest.

        Raises:
            NumericalError: no point is found, and some boxes are not decided.
            UnsupportedError: the formula is neither true nor false.
        """
        searches = [
            Search(self.engine, part, self.options, self.labels, self.bound)
            for part in conjuncts(self.formula)
        ]
        thresholds = [search.to_number() for search in searches]
        rest = deque([self.box])
        for step in range(_MOST_BOXES):
            if not rest:
                return None
            for part, point in self.parts(rest.pop() if step % 2 else rest.popleft()):
                verdicts: set[bool | None] = {None}
                if point is not None:
                    pairs = zip(searches, thresholds, strict=True)
                    verdicts = {s.verdict(part, point, threshold) for s, threshold in pairs}
                if verdicts == {True}:
                    return point
                if False not in verdicts:
                    rest.append(part)
        raise NumericalError(
            f"no point was found after {_MOST_BOXES} boxes, and there may be one",
            hint="smaller ranges may decide it",
        )

    def to_number(self) -> Threshold | None:
        """Search for the number before the threshold of the formula, which is given, if any."""
        if (threshold := self.threshold) is not None:
            assert isinstance(self.formula, Measure)
            query = query_of(self.formula, self.bound)
            direction = query.direction and query.direction.value
            self.formula = replace(self.formula, bound=None, direction=direction)
            adverse = Direction.MIN if threshold.operator.is_lower_bound else Direction.MAX
            self.any_strategy_violates = (
                query.direction is adverse
                and isinstance(query.quantity, PathProbability)
                and not self.is_nested
            )
        return threshold

    def verdict(self, box: Box, point: Point, threshold: Threshold | None) -> bool | None:
        """True: the formula holds at the point; False: it holds nowhere in the box; None: unknown.

        threshold: what the number that is searched for has to satisfy; None for a truth value.
        """
        if self.lifting and threshold is not None:
            verdict = self.decided(box, point, threshold)
            if verdict is None:
                box = {name: (value, value) for name, value in point.items()}
                verdict = self.decided(box, point, threshold) or None
            return verdict
        chosen = self.case(point)
        if chosen is None:
            return False if is_point(box) else None
        case = self.cases[chosen]
        if threshold is None:
            if not isinstance(case.value, bool):
                raise UnsupportedError(
                    f"a formula that is true or false has feasible points, and this is {case}",
                    hint="P>=0.5 [ … ] has a threshold; extremum(…) has the greatest value",
                )
            return case.value or (False if case.proved(box) else None)
        with suppress(ZeroDivisionError):
            if _all_admitted(threshold, case(**point)):
                return True
        proved = case.proved(box)
        enough = proved or self.any_strategy_violates
        if enough and any(_violated(threshold, v, box) for v in ends_of(case.value)):
            return False
        if not proved:
            with suppress(UnsupportedError):
                return False if self.decided(box, point, threshold) is False else None
        return None

    def regions(self, share: float) -> Regions:
        """Divide the box until a share of its volume is decided."""
        whole, number = volume(self.box), count()
        rest = (1 - Fraction(repr(share))) * whole
        queue: list[tuple[Fraction, int, Box, frozenset[Condition]]] = []
        heapq.heappush(queue, (-whole, next(number), self.box, frozenset()))
        left, empty = whole, []
        for _ in range(_MOST_BOXES):
            # A value that all boxes have is not that of their borders, unless it is proved there.
            done = left <= rest and (left > 0 or not self.has_one_value)
            if not queue or done:
                break
            negative, _, box, proved = heapq.heappop(queue)
            point = self.sample(box)
            if self.lifting and point is not None:
                done = self.by_lifting(box, point)
            elif point is None:
                done = self.is_empty(box)
                if done:
                    empty.append(box)
            elif (chosen := self.case(point)) is None:
                done = is_point(box)
                if done:
                    empty.append(box)
            else:
                conditions = self.cases[chosen].conditions or ()
                proved |= {c for c in conditions if c not in proved and c.proved(box)}
                done = proved.issuperset(conditions)
                if done:
                    self.boxes[chosen].append(box)
            if done:
                left += negative
                continue
            *halved, border = parts_of(box, self.box)
            for half in halved:
                heapq.heappush(queue, (negative / 2, next(number), half, proved))
            if not self.lifting:  # whose bounds hold on the borders of a box, too
                heapq.heappush(queue, (Fraction(0), next(number), border, proved))
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
            tuple(box for _, _, box, _ in queue) if left or self.has_one_value else (),
        )


def is_point(box: Box) -> bool:
    """Whether a box is a single point."""
    return all(low == high for low, high in box.values())


def _all_admitted(threshold: Threshold, value: Any) -> bool:
    """Whether a threshold admits a value, or both ends of a range of values."""
    return all(map(threshold.admits, ends_of(value)))


def _violated(threshold: Threshold, value: Any, box: Box) -> bool:
    """Whether it is proved that a threshold admits a number or function nowhere inside a box."""
    if not isinstance(value, RationalFunction):
        return not threshold.admits(value)
    difference = value - threshold.value
    sign = sign_on(difference.sign_parts, value.field, box)
    return sign is not None and not replace(threshold, value=Fraction(0)).admits(sign)


def _check_number(case: Case) -> None:
    """Refuse an outcome that is a truth value, a range of values, or infinite."""
    if isinstance(case.value, bool) or not isinstance(case.value, RationalFunction | Rational):
        hint = 'filter(max, …, "init") gives one number' if isinstance(case.value, tuple) else None
        raise UnsupportedError(
            f"only finite numbers have extremal values, and the value is {case}", hint=hint
        )


def check_parametric(
    engine: Engine,
    formula: Expression | Property,
    options: Options | None = None,
    *,
    model: BoundModel,
    labels: Mapping[str, Expression] | None = None,
) -> Result:
    """Check a bound formula on a model with parameters.

    Args:
        engine: that of functions, or of the corners of all ranges.
        formula: bound to the model.
        options: those that the engine was built with.
        model: the bound model.
        labels: those of the properties.

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
    search = Search(engine, formula, options, labels, model)
    regions = search.regions(options.regions)
    assert search.result is not None
    first, *others = regions.cases
    same = search.has_one_value
    strategies = (first.strategy,) if same and first.strategy is not None else ()
    where = [str(c) for c in regions.well_defined]
    explanation = search.result.explanation
    if not same:
        explanation = f"{len(regions.firsts)} cases"
    if regions.undecided:
        explanation += f"; {regions.share:.2%} of the volume are decided"
    if where:
        explanation += f"; where {', '.join(where)}"
    warnings = search.result.warnings
    if regions.share < options.regions:
        warnings += (
            f"the search ended after {_MOST_BOXES} boxes: {regions.share:.2%} of the volume are "
            f"decided, and {options.regions:.2%} were asked for",
        )
    no_strategy = search.result.no_strategy
    if not same and first.strategy is not None:
        no_strategy = f"each of {len(regions.cases)} cases has one (Python: result.regions.cases)"
        warnings += (f"no strategy: {no_strategy}",)
    return replace(
        search.result,
        warnings=warnings,
        value=first.value if same and not regions.undecided else None,
        accuracy=Exact(),
        explanation=explanation,
        values_or_none=None,
        satisfying_or_none=None if first.conditions or others else search.result.satisfying_or_none,
        strategies=strategies,
        no_strategy=no_strategy,
        regions_or_none=regions,
        seconds=perf_counter() - started,
    )
