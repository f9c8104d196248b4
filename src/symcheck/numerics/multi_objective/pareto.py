"""The Pareto front of any number of objectives: a polytope, by its vertices and facets.

The achievable values are a convex polytope; the objectives are maximised. Its upper boundary is
known from its support function: the greatest weighted sum of the objectives for each vector of
weights. The points that are found so far give a lower bound of this function, which is linear on
cells of the weight space. A linear program at each corner of a cell either finds a point beyond the
bound, or proves that the bound is right there. If it is right at all corners it is right
everywhere, because the support function is convex.

Sources: Forejt, Kwiatkowska & Parker (2012), 'Pareto curves for probabilistic model checking';
Ehrgott, Lohne & Shao (2012), 'A dual variant of Benson's outer approximation algorithm'; Motzkin,
Raiffa, Thompson & Thrall (1953), 'The double description method', for the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isinf
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers, full, numbers
from symcheck.numerics.multi_objective.exact_lp import Program, solve_program
from symcheck.numerics.multi_objective.linear_program import Flow

__all__ = ["Facet", "Front", "pareto_front"]

_MOST_POINTS = 1_000
"""Points up to which a front is refined: each cell of the weight space takes a linear program."""


@dataclass(frozen=True)
class Facet:
    """All achievable points x satisfy weights · x <= bound; the weights are >= 0, with sum 1."""

    weights: tuple[Fraction, ...]
    bound: Fraction


@dataclass(frozen=True, eq=False)
class Front:
    """The vertices of a Pareto front, [vertices, objectives], and its facets.

    The vertices are sorted by decreasing values of the first objective, then of the next ones.
    """

    vertices: Numbers
    facets: tuple[Facet, ...]


def pareto_front(flow: Flow, optimised: Sequence[int], least: Numbers) -> Front | None:
    """The Pareto front of some objectives.

    Args:
        flow: the flow of the MDP.
        optimised: the numbers of the objectives, at least one.
        least: lower bounds of all objectives.

    Returns:
        The front; None if the bounds cannot be met.

    Raises:
        NumericalError: an objective is unbounded, or the front has too many vertices.
    """
    chosen = list(optimised)

    def best(weights: Sequence[Fraction]) -> Numbers | None:
        w = full(flow.objectives, 0, rational=flow.is_rational)
        w[chosen] = numbers(np.array(weights, dtype=object), rational=flow.is_rational)
        optimum = flow.best(w, least)
        if optimum is None:
            return None
        if isinf(optimum.value):
            raise NumericalError(
                "a reward of this Pareto query has no bound: some strategy collects it for ever"
            )
        return np.asarray(optimum.gains[chosen])

    first = best([Fraction(1, len(chosen))] * len(chosen))
    if first is None:
        return None
    cells, points = _Cells(_rational(first)), [first]
    proved: set[tuple[Fraction, ...]] = set()
    while (facet := next((f for f in cells.facets() if f.weights not in proved), None)) is not None:
        point = best(facet.weights)
        tolerance = Fraction(flow.tolerance) * max(Fraction(1), *map(abs, _rational(points[0])))
        if point is None:  # the constraints are those of the first point
            raise NumericalError(
                "a linear program of this Pareto query fails by rounding: use -exact"
            )
        if _dot(facet.weights, _rational(point)) <= facet.bound + tolerance:
            proved.add(facet.weights)
            continue
        if len(points) == _MOST_POINTS:
            raise NumericalError(f"this Pareto front has more than {_MOST_POINTS:,} vertices")
        points.append(point)
        cells.add(_rational(point))
    vertices = sorted(_vertices(points, flow.tolerance), key=tuple, reverse=True)
    return Front(np.array(vertices), tuple(cells.facets()))


def _vertices(points: Sequence[Numbers], tolerance: float | Fraction) -> list[Numbers]:
    """The points that are not below a convex combination of others, within the tolerance."""
    kept = list(points)
    for point in points:
        others = [p for p in kept if p is not point]
        if others and _excess(point, others) <= 10 * tolerance * max(1, np.abs(point).max()):
            kept = others
    return kept


def _excess(point: Numbers, others: Sequence[Numbers]) -> Any:
    """By how much every convex combination of `others` is below a point in some coordinate."""
    k, d = len(others), len(point)
    exact = isinstance(point[0], Fraction)
    one, zero = full(1, 1, rational=exact)[0], full(1, 0, rational=exact)[0]
    # Combination + excess - surplus = point, in each coordinate. The excess is a difference.
    matrix = np.concatenate(
        (
            np.array(others).T,
            np.full((d, 1), one),
            np.full((d, 1), -one),
            np.where(np.eye(d) > 0, -one, zero),
        ),
        axis=1,
    )
    sums = np.array([one] * k + [zero] * (d + 2))
    matrix = np.concatenate((matrix, sums[None]))
    cost = np.array([zero] * k + [-one, one] + [zero] * d)
    rows, columns = np.nonzero(matrix != 0)
    right = np.append(point, one)
    optimum = solve_program(Program(rows, columns, matrix[rows, columns], right, cost))
    assert optimum is not None
    return -optimum.value


@dataclass
class _Ray:
    """An extreme ray (weights, bound) of the cone, and the constraints that hold with equality."""

    weights: tuple[Fraction, ...]
    bound: Fraction
    tight: frozenset[int]


class _Cells:
    """The cone of all (weights, bound) with weights >= 0 and weights · p <= bound for each point p.

    Its extreme rays with positive weights are the corners of the cells of the weight space, on each
    of which one point is the best.
    """

    def __init__(self, point: Sequence[Fraction]) -> None:
        d = len(point)
        unit = [tuple(Fraction(i == j) for i in range(d)) for j in range(d)]
        everything = frozenset(range(d + 1))
        self._rays = [_Ray(unit[j], point[j], everything - {j}) for j in range(d)]
        self._rays.append(_Ray((Fraction(0),) * d, Fraction(1), everything - {d}))
        self._constraints = d + 1

    def facets(self) -> list[Facet]:
        """The corners, with weights whose sum is 1."""
        return [Facet(r.weights, r.bound) for r in self._rays if any(r.weights)]

    def add(self, point: Sequence[Fraction]) -> None:
        """Add the constraint of a point: a step of the double description method."""
        new = self._constraints
        self._constraints += 1
        slack = [r.bound - _dot(r.weights, point) for r in self._rays]
        kept = [r for r, s in zip(self._rays, slack, strict=True) if s > 0]
        kept += [
            _Ray(r.weights, r.bound, r.tight | {new})
            for r, s in zip(self._rays, slack, strict=True)
            if s == 0
        ]
        for a, above in zip(self._rays, slack, strict=True):
            for b, below in zip(self._rays, slack, strict=True):
                if above > 0 > below and self._adjacent(a, b):
                    kept.append(_between(a, above, b, below, new))
        self._rays = kept

    def _adjacent(self, a: _Ray, b: _Ray) -> bool:
        common = a.tight & b.tight
        return len(common) >= len(a.weights) - 1 and not any(
            common <= r.tight for r in self._rays if r is not a and r is not b
        )


def _between(a: _Ray, above: Fraction, b: _Ray, below: Fraction, new: int) -> _Ray:
    """The ray between two of them on which the new constraint holds with equality."""
    weights = [above * y - below * x for x, y in zip(a.weights, b.weights, strict=True)]
    total = sum(weights)
    return _Ray(
        tuple(w / total for w in weights),
        (above * b.bound - below * a.bound) / total,
        (a.tight & b.tight) | {new},
    )


def _rational(point: Numbers) -> list[Fraction]:
    return [Fraction(x) for x in point.tolist()]


def _dot(weights: Sequence[Fraction], point: Sequence[Fraction]) -> Fraction:
    return sum((w * x for w, x in zip(weights, point, strict=True)), Fraction(0))
