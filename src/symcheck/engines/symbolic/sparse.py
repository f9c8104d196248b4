"""The sparse engine: built as diagrams, solved on compressed rows of the states in question."""

from __future__ import annotations

from typing import ClassVar

from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.matrices.rows import SparseMatrix

__all__ = ["SparseEngine"]


class SparseEngine(SymbolicEngine):
    """Rows are written from repeated blocks; all methods on rows apply."""

    name: ClassVar[str] = "sparse"
    has_rows: ClassVar[bool] = True
    rows_limit: ClassVar[int | None] = None

    def operator(self, system: SymbolicSystem) -> SparseMatrix:
        """The rows as an operator."""
        return system.matrix
