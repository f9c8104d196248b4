"""Stub of the compiled row builder."""

import numpy as np
from numpy.typing import NDArray

class CsrBuilder:
    opened: int
    closed: int
    groups: int
    entries: int
    def __init__(self, structures: int) -> None: ...
    @property
    def nbytes(self) -> int: ...
    def build(
        self,
        order: NDArray[np.int32],
        rank: NDArray[np.int32],
        indptr: NDArray[np.int64],
        indices: NDArray[np.int32],
        data: NDArray[np.float64],
        groups: NDArray[np.int64] | None,
        actions: NDArray[np.int32],
        rewards: list[NDArray[np.float64]],
    ) -> None: ...
