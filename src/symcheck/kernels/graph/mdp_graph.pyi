import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Int32s, Int64s

_Mask = NDArray[np.uint8]

def attractor(
    pre: Int64s, rows_in: Int32s, owner: Int32s, groups: Int64s, target: _Mask, through: _Mask
) -> _Mask: ...
def almost_sure(
    indptr: Int64s,
    indices: Int32s,
    groups: Int64s,
    pre: Int64s,
    rows_in: Int32s,
    owner: Int32s,
    target: _Mask,
    through: _Mask,
) -> tuple[_Mask, Int64s]: ...
def end_components(
    indptr: Int64s,
    indices: Int32s,
    groups: Int64s,
    pre: Int64s,
    rows_in: Int32s,
    owner: Int32s,
    within: _Mask,
    usable: _Mask | None,
) -> tuple[Int32s, _Mask, int]: ...
