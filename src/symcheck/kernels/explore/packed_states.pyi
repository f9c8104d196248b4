"""Types of the compiled order on packed states."""

import numpy as np
from numpy.typing import NDArray

def order_rows(
    rows: NDArray[np.uint64], order: NDArray[np.int32], rank: NDArray[np.int32]
) -> None: ...
def find_rows(
    table: NDArray[np.uint64], wanted: NDArray[np.uint64], found: NDArray[np.int32]
) -> None: ...
