"""The hybrid engine: built as diagrams, multiplied block by block without writing rows out; vectors
are arrays.
"""

from __future__ import annotations

from typing import ClassVar

from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.matrices.blocks import BlockMatrix

__all__ = ["HybridEngine"]


class HybridEngine(SymbolicEngine):
    """Distinct blocks of the matrix are stored once each; a product visits their places.

    Equations of up to 200 MB are solved on rows all the same: components in order need far fewer
    steps than products do.
    """

    name: ClassVar[str] = "hybrid"
    rows_limit: ClassVar[int | None] = 16_000_000

    def operator(self, system: SymbolicSystem) -> BlockMatrix:
        """The blocks as an operator."""
        return system.blocks
