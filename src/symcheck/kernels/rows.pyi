import numpy as np
from numpy.typing import NDArray

from symcheck.numerics.matrix import Floats, Int32s, Int64s

_Mask = NDArray[np.uint8]

def sum_into(indptr: Int64s, indices: Int32s, data: Floats, rows: Int64s, member: _Mask, out: Floats) -> None: ...
def sum_values(indptr: Int64s, indices: Int32s, data: Floats, rows: Int64s, member: _Mask, values: Floats, out: Floats) -> None: ...
