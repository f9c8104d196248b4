"""Stub of the order of packed states."""

import numpy as np
from numpy.typing import NDArray

def sort_rows(
    rows: NDArray[np.uint64], order: NDArray[np.int32], rank: NDArray[np.int32]
) -> None: ...
def find_rows(
    table: NDArray[np.uint64], requested: NDArray[np.uint64], positions: NDArray[np.int32]
) -> None: ...
