import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s

_Values = NDArray[np.generic]  # uint8, uint16 or float64

def distinct_values(data: Floats, largest: int) -> Floats | None: ...
def triangle_sizes(
    indptr: Int64s, indices: Int32s, lower: Int32s, upper: Int32s
) -> tuple[int, int]: ...
def fill_triangles(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    table: Floats,
    lower_indices: Int32s,
    lower_values: _Values,
    upper_indices: Int32s,
    upper_values: _Values,
) -> None: ...
def diagonal(indptr: Int64s, indices: Int32s, data: Floats) -> Floats: ...
def solve_upper(
    count: Int32s,
    indices: Int32s,
    values: _Values,
    table: Floats,
    scale: Floats,
    r: Floats,
    p: Floats,
    v: Floats,
    beta: float,
    gamma: float,
    t: Floats,
) -> None: ...
def solve_lower(
    count: Int32s,
    indices: Int32s,
    values: _Values,
    table: Floats,
    scale: Floats,
    v: Floats,
    t: Floats,
    w: Floats,
    out: Floats,
    other: Floats,
) -> tuple[float, float]: ...
def update_iterate(
    x: Floats, p: Floats, r: Floats, q: Floats, shadow: Floats, alpha: float, omega: float
) -> tuple[float, float, float]: ...
def add_multiple(y: Floats, z: Floats, c: float, other: Floats) -> tuple[float, float]: ...
