"""The three forms of the matrix of a symbolic engine: compressed rows, blocks, and diagrams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.matrices.blocks import BlockMatrix
from symcheck.matrices.operators import BoundStep, underflow_error
from symcheck.matrices.rows import Floats, SparseMatrix

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["DiagramOperator", "HybridEngine", "MtbddEngine", "SparseEngine"]


@dataclass(frozen=True, eq=False)
class DiagramOperator:
    """The matrix as a diagram (one per choice class): products of diagrams, arrays at both ends."""

    system: SymbolicSystem = field(repr=False)
    divisor: Floats | None = field(default=None, repr=False)

    def divided(self, divisor: Floats) -> DiagramOperator:
        """The operator with each row divided by a number: float64[rows]."""
        return replace(self, divisor=divisor)

    @property
    def longest(self) -> int:
        """A bound on the entries of a row, for the rounding of sums."""
        blocks: BlockMatrix = self.system.blocks
        return blocks.longest

    def apply(self, x: Mtbdd) -> tuple[Mtbdd, ...]:
        """A x per choice class, functions of the row bits; `x` is one too, 0 outside the states."""
        d = self.system.engine.diagrams
        columns = x.rename(d.to_columns)
        return tuple(root.multiply_sum(columns, d.column_cube) for root in self.system.roots)

    def multiply(self, x: Floats) -> Floats:
        """A x: a value per row."""
        product = self.system.per_row(self.apply(self.system.odd.from_vector(x)))
        return product if self.divisor is None else product / self.divisor

    def sweep(self, x: Floats, step: BoundStep) -> None:
        """Some steps on bounds, float64[n], in place, all on diagrams."""
        odd = self.system.odd
        add = self._by_class(step.constant)
        scale = None if self.divisor is None else self._by_class(1.0 / self.divisor)
        bounds = odd.from_vector(x)
        states, error = self.system.states.bdd, underflow_error(self.divisor)
        underflow = states.to_mtbdd(error if step.upper else -error)
        for _ in range(tuning.SWEEP_STEPS):
            rows = self.apply(bounds)
            if scale is not None:
                rows = tuple(row * by for row, by in zip(rows, scale, strict=True))
            best = self._best([row + b for row, b in zip(rows, add, strict=True)], step.direction)
            if step.upper:
                after = bounds.minimum(best * (1.0 + step.rounding_error) + underflow)
            else:
                after = bounds.maximum(best * (1.0 - step.rounding_error) + underflow)
            if after == bounds:
                break
            bounds = after
        x[:] = odd.to_vector(bounds)

    def _by_class(self, values: Floats) -> list[Mtbdd]:
        """A value per row as a function of the state per choice class."""
        layout, odd = self.system.layout, self.system.odd
        if layout is None:
            return [odd.from_vector(values)]
        functions = []
        for present, rows in layout.each():
            full = np.zeros(self.system.n)
            full[present] = values[rows]
            functions.append(odd.from_vector(full))
        return functions

    def _best(self, rows: Sequence[Mtbdd], direction: Direction | None) -> Mtbdd:
        """The best choice of each state; 0 outside of the states."""
        guards, states = self.system.engine.diagrams.guards, self.system.states.bdd
        if guards is None:
            return rows[0].times_bdd(states)
        worst = -np.inf if direction == Direction.MAX else np.inf
        best, *others = [guard.ite(row, worst) for row, guard in zip(rows, guards, strict=True)]
        for other in others:
            best = best.maximum(other) if direction == Direction.MAX else best.minimum(other)
        return states.ite(best, 0.0)


class SparseEngine(SymbolicEngine):
    """Solved on compressed rows, which are written from repeated blocks: all methods apply."""

    name: ClassVar[str] = "sparse"
    has_rows: ClassVar[bool] = True
    rows_limit: ClassVar[int | None] = None

    def operator(self, system: SymbolicSystem) -> SparseMatrix:
        """The rows as an operator."""
        return system.weights


class HybridEngine(SymbolicEngine):
    """Products by distinct blocks, which are stored once; vectors are arrays.

    Equations of up to 200 MB are solved on rows: component by component, they need far fewer steps.
    """

    name: ClassVar[str] = "hybrid"
    rows_limit: ClassVar[int | None] = 16_000_000

    def operator(self, system: SymbolicSystem) -> BlockMatrix:
        """The blocks as an operator."""
        return system.blocks


class MtbddEngine(SymbolicEngine):
    """Vectors are diagrams, so that a product costs nodes, not states; small systems use blocks."""

    name: ClassVar[str] = "mtbdd"
    rows_limit: ClassVar[int | None] = 200_000

    def operator(self, system: SymbolicSystem) -> DiagramOperator | BlockMatrix:
        """The diagrams as an operator, or the blocks of a small system."""
        return system.blocks if system.has_rows else DiagramOperator(system)
