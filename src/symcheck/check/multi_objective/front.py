"""The Pareto front of a linear program, in terms of the objectives as they are written."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from symcheck.check.multi_objective.flow import Objective
from symcheck.check.pareto_front import Halfspace, Number, ParetoFront
from symcheck.numerics.multi_objective.pareto import Front

__all__ = ["front_of"]


def front_of(objectives: Sequence[Objective], front: Front, *, exact: bool) -> ParetoFront:
    """The front in terms of the objectives as they are written.

    Args:
        objectives: those of the front.
        front: their front for maximisation.
        exact: whether numbers stay rationals.
    """

    def plain(value: Number) -> Number:
        return Fraction(value) if exact else float(value)

    halfspaces = []
    for facet in front.facets:
        # The internal value is sign · x + shift.
        shift = sum(
            w
            for o, w in zip(objectives, facet.weights, strict=True)
            if o.probability and o.sign < 0
        )
        weights = (plain(o.sign * w) for o, w in zip(objectives, facet.weights, strict=True))
        halfspaces.append(Halfspace(tuple(weights), plain(facet.bound - shift)))
    return ParetoFront(
        tuple(o.text for o in objectives),
        tuple(
            tuple(plain(o.shown(x)) for o, x in zip(objectives, point, strict=True))
            for point in front.vertices.tolist()
        ),
        tuple(halfspaces),
    )
