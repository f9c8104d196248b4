from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Int32s

class EpochSolver:
    sweeps: int
    def __init__(
        self, layer: Any, mode: int, floor: int, clear: Int32s, tolerance: float, limit: int
    ) -> None: ...
    def advance(self, x: NDArray[np.float64], level: int, stop: int) -> int: ...
