from typing import Any

import numpy as np
from numpy.typing import NDArray

_Int32s = NDArray[np.int32]
_Int64s = NDArray[np.int64]
_Floats = NDArray[np.float64]

def expand(
    depth: _Int32s,
    low: _Int32s,
    high: _Int32s,
    count: _Int64s,
    root: int,
    level: _Int32s,
    tlow: _Int32s,
    thigh: _Int32s,
    value: _Floats,
    troot: int,
    levels: _Int32s,
    out: NDArray[Any],
) -> None: ...
def collapse(
    depth: _Int32s, low: _Int32s, high: _Int32s, count: _Int64s, root: int, bits: NDArray[np.uint64], levels: _Int32s, bottom: int
) -> tuple[_Int32s, _Int32s, _Int32s, int]: ...
def number(values: _Floats, ids: _Int32s) -> _Floats: ...
def vector_table(
    depth: _Int32s, low: _Int32s, high: _Int32s, count: _Int64s, root: int, ids: _Int32s, leaves: int, levels: _Int32s, bottom: int
) -> tuple[_Int32s, _Int32s, _Int32s, int]: ...
