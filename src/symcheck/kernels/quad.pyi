from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

_Int32s = NDArray[np.int32]
_Int64s = NDArray[np.int64]
_Floats = NDArray[np.float64]
_Odd = tuple[_Int32s, _Int32s, _Int32s, _Int64s, int]

class Quad:
    rows: int
    columns: int
    triples: int
    nodes: int
    entries: _Int64s
    def __init__(
        self,
        level: _Int32s,
        low: _Int32s,
        high: _Int32s,
        values: _Floats,
        roots: _Int32s,
        row: _Odd,
        col: _Odd,
        row_levels: _Int32s,
        col_levels: _Int32s,
    ) -> None: ...
    def cut(self, budget: int) -> Blocks: ...

class Blocks:
    rows: int
    columns: int
    roots: int
    entries: _Int64s
    threshold: int
    @property
    def nbytes(self) -> int: ...
    @property
    def statistics(self) -> Mapping[str, int]: ...
    def multiply(self, root: int, x: _Floats, y: _Floats) -> None: ...
    def multiply_rows(self, root: int, x: _Floats, y: _Floats, low: int, high: int) -> None: ...
    def multiply_transposed(self, root: int, x: _Floats, y: _Floats) -> None: ...
    def diagonal(self, root: int, out: _Floats) -> None: ...
    def count_rows(self, root: int, counts: _Int32s) -> None: ...
    def fill(self, root: int, next_: _Int64s, indices: _Int32s, data: _Floats) -> None: ...
