import numpy as np
from numpy.typing import NDArray

def row_signatures(
    indptr: NDArray[np.int64],
    indices: NDArray[np.int32],
    data: NDArray[np.float64],
    groups: NDArray[np.int64],
    seeds: NDArray[np.uint64],
    block: NDArray[np.int32],
    blocks: int,
    states: NDArray[np.int64],
    out: NDArray[np.uint64],
) -> None: ...
