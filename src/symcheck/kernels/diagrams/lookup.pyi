import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s

def lookup(
    level: Int32s,
    low: Int32s,
    high: Int32s,
    values: Floats,
    root: int,
    place: Int32s,
    bits: NDArray[np.uint8],
    out: Floats,
) -> None: ...
