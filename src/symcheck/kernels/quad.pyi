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
