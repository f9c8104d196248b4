from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s

def expand(
    depth: Int32s,
    low: Int32s,
    high: Int32s,
    count: Int64s,
    root: int,
    level: Int32s,
    tlow: Int32s,
    thigh: Int32s,
    value: Floats,
    troot: int,
    levels: Int32s,
    out: NDArray[Any],
) -> None: ...
def collapse(
    depth: Int32s,
    low: Int32s,
    high: Int32s,
    count: Int64s,
    root: int,
    bits: NDArray[np.uint64],
    levels: Int32s,
    bottom: int,
) -> tuple[Int32s, Int32s, Int32s, int]: ...
def number(values: Floats, ids: Int32s) -> Floats: ...
def vector_table(
    depth: Int32s,
    low: Int32s,
    high: Int32s,
    count: Int64s,
    root: int,
    ids: Int32s,
    leaves: int,
    levels: Int32s,
    bottom: int,
) -> tuple[Int32s, Int32s, Int32s, int]: ...
