import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s

_Mask = NDArray[np.uint8]

def reach(edges: Int64s, indices: Int32s, table: Int32s, letter: Int32s, initial: int, found: _Mask) -> None: ...
def split(found: _Mask, size: int, state: Int32s, automaton: Int32s, number: Int32s) -> None: ...
def rows(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    chosen: Int64s,
    following: Int32s,
    number: Int32s,
    size: int,
    out_indptr: Int64s,
    out_indices: Int32s,
    out_data: Floats,
) -> None: ...
def matching(state: Int32s, automaton: Int32s, letter: Int32s, wanted: _Mask, out: _Mask) -> None: ...
