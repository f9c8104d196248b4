"""Types of the compiled expansion of states."""

from typing import Any

from symcheck.kernels.rows.csr_builder import RowStore

class Expander:
    rows: RowStore
    def __init__(self, tables: Any) -> None: ...
    @property
    def nbytes(self) -> int: ...
