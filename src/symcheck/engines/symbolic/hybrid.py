"""The hybrid engine: built as diagrams, products by distinct blocks, vectors as arrays."""

from __future__ import annotations

from typing import ClassVar

from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.matrices.blocks import BlockMatrix

__all__ = ["HybridEngine"]


class HybridEngine(SymbolicEngine):
    """Distinct blocks of the matrix are stored once; a product visits their occurrences.

    Equations of up to 200 MB are solved on rows: component by component, they need far fewer steps.
    """

    name: ClassVar[str] = "hybrid"
    rows_limit: ClassVar[int | None] = 16_000_000

    def operator(self, system: SymbolicSystem) -> BlockMatrix:
        """The blocks as an operator."""
        return system.blocks
