"""A multi-objective query as linear programs over the flow of a product."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, nan

import numpy as np

from symcheck.check.multi_objective.flow import Objective
from symcheck.check.multi_objective.front import front_of
from symcheck.check.pareto_front import ParetoFront
from symcheck.check.result import Answer, Number
from symcheck.engines.base import Engine
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite, numbers
from symcheck.numerics.multi_objective import linear_program as numerics
from symcheck.numerics.multi_objective.pareto import Front, pareto_front

__all__ = ["LinearQuery", "is_cost"]

_DOUBT = 100 * numerics.TOLERANCE
"""The smallest margin of a linear program at which a verdict is given without proof."""


def is_cost(objective: Objective) -> bool:
    """Whether an objective is a reward that is to be small and may be infinite."""
    return objective.sign < 0 and not objective.probability and not objective.long_run


def _plain(value: Number) -> Number:
    """A number without the types of numpy."""
    return value if isinstance(value, Fraction) else float(value)


_NONE = "no strategy satisfies the bounds"
_NO_CURVE = "no strategy satisfies the bounds with finite costs"


@dataclass
class LinearQuery:
    """A query whose objectives are linear in the variables of a flow.

    Attributes:
        objectives: the objectives.
        optimised: the numbers of those without a bound.
        engine: the product through which the flow goes.
        flow: its equations.
        least: the bounds, for maximisation; -inf for none.
        close: whether the result is within the rounding error of doubles.
        front: of a Pareto query.
        connected: the equations without circulation that is never entered.
        solution: values of its variables that attain the result, unless it is a front.
        corners: the front, for maximisation.
    """

    objectives: Sequence[Objective]
    optimised: Sequence[int]
    engine: Engine
    flow: numerics.Flow
    least: Numbers
    close: bool = False
    front: ParetoFront | None = None
    connected: numerics.Flow | None = None
    solution: Numbers | None = None
    corners: Front | None = None

    def answer(self) -> tuple[Answer, str]:
        """The value, and an explanation."""
        self.connected = flow = self.flow.connected(self.least)
        room = None if is_infinite(self.least).all() else flow.margin(self.least)
        if not is_infinite(self.least).all():
            if room is None:
                self.close = not flow.is_rational  # the margin is unknown
                return self._none(), _NONE
            self.close = not flow.is_rational and -_DOUBT <= room.value <= _DOUBT
            if room.value < -flow.tolerance:
                about = f"{_NONE}: they are missed by {float(-room.value):.3g}"
                return self._none(), about
        if not self.optimised:
            self.solution = None if room is None else room.x
            excess = 0.0 if room is None else float(max(0, room.value))
            about = f"all bounds can be exceeded by {excess:.3g} together"
            return True, "" if room is None else about
        # Bounds that are satisfied with equality are relaxed by the rounding error.
        least = self.least if room is None else np.minimum(self.least, self.least + room.value)
        return self._best(flow, least) if len(self.optimised) == 1 else self._curve(flow, least)

    def solutions(self) -> Iterator[Numbers]:
        """The solutions that attain the result: one, or one for each vertex of a front."""
        flow = self.connected
        if flow is None:
            return
        if self.solution is not None:
            yield self.solution
        if self.corners is not None:
            for vertex in self.corners.vertices:
                yield self._corner(flow, self.corners, vertex)

    def _corner(self, flow: numerics.Flow, corners: Front, vertex: Numbers) -> Numbers:
        """The solution at a vertex: optimal for weights between those of the facets around it."""
        chosen, slack = list(self.optimised), 10 * flow.tolerance * max(1, *np.abs(vertex))
        tight = [
            numbers(np.array(f.weights, dtype=object), rational=flow.is_rational)
            for f in corners.facets
            if sum(w * x for w, x in zip(f.weights, vertex, strict=True)) >= f.bound - slack
        ]
        weights = full(len(self.objectives), 0, rational=flow.is_rational)
        weights[chosen] = sum(tight)
        optimum = flow.best(weights, self.least)
        if optimum is None or optimum.x is None or (optimum.gains[chosen] < vertex - slack).any():
            least = self.least.copy()
            least[chosen] = vertex - slack
            optimum = flow.best(weights, least)
        if optimum is None or optimum.x is None:
            raise UnsupportedError("a linear program fails by rounding: use -exact")
        return optimum.x

    def _none(self) -> Answer:
        """The value of an achievability, a numerical or a Pareto query without any strategy."""
        return (False, nan)[len(self.optimised)] if len(self.optimised) < 2 else []

    def _best(self, flow: numerics.Flow, least: Numbers) -> tuple[Answer, str]:
        (index,) = self.optimised
        weights = full(len(self.objectives), 0, rational=flow.is_rational)
        weights[index] = full(1, 1, rational=flow.is_rational)[0]
        optimum = flow.best(weights, least)
        if optimum is None:
            return nan, _NONE
        if optimum.x is None:
            return inf, "rewards can be accumulated without bound"
        self.solution = optimum.x
        optimal = "optimal vertex of the achievable set"
        about = optimal if flow.is_rational else f"the dual bound differs by {optimum.gap:.1E}"
        return _plain(self.objectives[index].shown(optimum.value)), about

    def _curve(self, flow: numerics.Flow, least: Numbers) -> tuple[Answer, str]:
        front = pareto_front(flow, self.optimised, least)
        if front is None:
            return self._none(), _NO_CURVE
        optimised = [self.objectives[i] for i in self.optimised]
        self.front = front_of(optimised, front, exact=flow.is_rational)
        self.corners = front
        return list(self.front.vertices), "Pareto curve" if len(optimised) == 2 else "Pareto front"
