"""The Pareto front of a multi-objective query, as a value and as a table."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from symcheck.errors import UnsupportedError
from symcheck.semantics.expressions.literals import format_value
from symcheck.tables import Columns, Table, Tabular

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Halfspace", "Number", "ParetoFront", "rounded"]

Number = float | Fraction


def rounded(value: Number) -> Number:
    """The nearest double; a rational so close to 0 that a double loses digits stays as it is.

    Examples:
        >>> rounded(Fraction(1, 4)), rounded(Fraction(1, 10**400)) > 0
        (0.25, True)
    """
    tiny = isinstance(value, Fraction) and 0 < abs(value) < sys.float_info.min
    return value if tiny else float(value)


@dataclass(frozen=True)
class Halfspace:
    """All achievable points x satisfy weights · x <= bound.

    The weights of objectives that are minimised are negative; the sum of absolute values is 1.
    """

    weights: tuple[Number, ...]
    bound: Number


@dataclass(frozen=True)
class ParetoFront(Tabular):
    """The Pareto front of a multi-objective query: the best points of a convex polytope.

    A strategy achieves each convex combination of the vertices, and whatever is worse.

    Attributes:
        objectives: the texts of the objectives.
        vertices: a point per vertex: the value of each objective, sorted by the first one.
        halfspaces: their intersection is the set of all points that some strategy achieves, or
            that are worse.
    """

    objectives: tuple[str, ...]
    vertices: tuple[tuple[Number, ...], ...]
    halfspaces: tuple[Halfspace, ...]

    def rounded(self) -> ParetoFront:
        """The front with doubles; see `rounded`."""

        def doubles(values: Sequence[Number]) -> tuple[Number, ...]:
            return tuple(map(rounded, values))

        return ParetoFront(
            self.objectives,
            tuple(map(doubles, self.vertices)),
            tuple(Halfspace(doubles(h.weights), rounded(h.bound)) for h in self.halfspaces),
        )

    def plot(self, axes: Axes | None = None) -> Axes:
        """Plot the front of two objectives, by matplotlib, into new axes if none are given.

        Raises:
            UnsupportedError: there are not two objectives, or matplotlib is not installed.
        """
        if len(self.objectives) != 2:
            raise UnsupportedError(f"the front of {len(self.objectives)} objectives has no plot")
        from symcheck.charts import plot_front

        points = [(float(x), float(y)) for x, y in self.vertices]
        return plot_front(points, (self.objectives[0], self.objectives[1]), axes)

    def columns(self) -> Columns:
        """The number of each vertex, and the values of each objective."""
        values = zip(*self.vertices, strict=True)
        heads = {
            text if self.objectives.count(text) == 1 else f"{text} #{i + 1}": v
            for i, (text, v) in enumerate(zip(self.objectives, values, strict=True))
        }
        return {"vertex": range(1, len(self.vertices) + 1), **heads}

    def _table(self) -> Table:
        rows = ((i, *map(format_value, vertex)) for i, vertex in enumerate(self.vertices, 1))
        return Table.of(tuple(self.columns()), rows)
