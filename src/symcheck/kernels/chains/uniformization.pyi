import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s

def steps(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    diagonal: Floats,
    y: Floats,
    z: Floats,
    total: Floats,
    weights: Floats,
    floor: float,
) -> tuple[bool, float, float, float]: ...
def nearest_first(indptr: Int64s, indices: Int32s, sources: NDArray[np.uint8]) -> Int32s: ...
