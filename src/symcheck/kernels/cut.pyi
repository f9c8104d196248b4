from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.quad import Quad

_Int64s = NDArray[np.int64]

class Cut:
    rows: int
    columns: int
    roots: int
    parts: int
    threshold: int
    entries: _Int64s
    part_rows: _Int64s
    part_work: _Int64s
    def __init__(self, quad: Quad, budget: int, ordered: bool = False, range_rows: int = 32768) -> None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def statistics(self) -> Mapping[str, int]: ...
    def listing(self) -> tuple[_Int64s, _Int64s]: ...
