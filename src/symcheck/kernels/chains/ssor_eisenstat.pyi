import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s

_Values = NDArray[np.generic]  # uint8, uint16 or float64

def distinct(data: Floats, most: int) -> Floats | None: ...
def sizes(indptr: Int64s, indices: Int32s, lower: Int32s, upper: Int32s) -> tuple[int, int]: ...
def fill(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    table: Floats,
    low_idx: Int32s,
    low_val: _Values,
    up_idx: Int32s,
    up_val: _Values,
) -> None: ...
def loops(indptr: Int64s, indices: Int32s, data: Floats) -> Floats: ...
def back(
    count: Int32s, idx: Int32s, val: _Values, table: Floats, scale: Floats, r: Floats, p: Floats, v: Floats, beta: float, gamma: float,
    t: Floats,
) -> None: ...  # fmt: skip
def forth(
    count: Int32s,
    idx: Int32s,
    val: _Values,
    table: Floats,
    scale: Floats,
    v: Floats,
    t: Floats,
    w: Floats,
    out: Floats,
    other: Floats,
) -> tuple[float, float]: ...
def update(
    x: Floats, p: Floats, r: Floats, q: Floats, shadow: Floats, alpha: float, omega: float
) -> tuple[float, float, float]: ...
def shift(y: Floats, z: Floats, c: float, other: Floats) -> tuple[float, float]: ...
