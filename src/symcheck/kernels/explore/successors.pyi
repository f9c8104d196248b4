"""Types of the compiled expansion of states."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.rows.csr_builder import CsrBuilder

class Expander:
    rows: CsrBuilder
    def __init__(self, tables: Any) -> None: ...
    @property
    def nbytes(self) -> int: ...
    def successors(
        self, states: NDArray[np.uint64]
    ) -> tuple[
        int,
        int,
        tuple[
            NDArray[np.int64],
            NDArray[np.int64],
            NDArray[np.int32],
            NDArray[np.float64],
            NDArray[np.uint64],
            NDArray[np.int64],
        ]
        | None,
    ]: ...
