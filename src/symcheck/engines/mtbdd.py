"""The MTBDD engine: vectors are diagrams too, so that what it needs grows with structure and not with states."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from symcheck.engines.symbolic import SymbolicEngine
from symcheck.engines.symbolic_system import SymbolicSystem
from symcheck.numerics.matrix import Floats

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["DiagramOperator", "MtbddEngine"]


@dataclass(frozen=True, eq=False)
class DiagramOperator:
    """The matrix as a diagram (one per slot): products of diagrams, arrays at both ends."""

    system: SymbolicSystem = field(repr=False)

    def apply(self, x: Mtbdd) -> tuple[Mtbdd, ...]:
        """A x for each slot, as functions of the row bits; `x` too is one, 0 outside of the states."""
        d = self.system.engine.diagrams
        columns = x.rename(d.to_columns)
        return tuple(root.multiply_sum(columns, d.column_cube) for root in self.system.roots)

    def multiply(self, x: Floats) -> Floats:
        """A x: a value per row."""
        return self.system.per_row(self.apply(self.system.odd.from_vector(x)))


class MtbddEngine(SymbolicEngine):
    """Products are made on diagrams; small equations are solved on rows, as components in order need no products."""

    name: ClassVar[str] = "mtbdd"
    rows_limit: ClassVar[int | None] = 200_000

    def operator(self, system: SymbolicSystem) -> DiagramOperator:
        """The diagrams as an operator."""
        return DiagramOperator(system)
