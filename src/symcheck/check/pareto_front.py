"""The Pareto front of a multi-objective query, as a value and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from symcheck.semantics.expressions.literals import format_value
from symcheck.tables import Columns, Table, Tabular

__all__ = ["Halfspace", "Number", "ParetoFront"]

Number = float | Fraction


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
        """The front with doubles."""

        def doubles(values: Sequence[Number]) -> tuple[float, ...]:
            return tuple(map(float, values))

        return ParetoFront(
            self.objectives,
            tuple(map(doubles, self.vertices)),
            tuple(Halfspace(doubles(h.weights), float(h.bound)) for h in self.halfspaces),
        )

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
