import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s

__all__ = ["Partition", "largest_row_sum"]

def largest_row_sum(
    level: Int32s, low: Int32s, high: Int32s, weight: Floats, roots: Int32s
) -> float: ...

class Partition:
    blocks: int
    rounds: int
    threshold: int
    deadline: float
    @property
    def memory(self) -> int: ...
    @property
    def size(self) -> int: ...
    def __init__(
        self,
        bits: int,
        level: Int32s,
        low: Int32s,
        high: Int32s,
        weight: Floats,
        roots: Int32s,
        choices: bool,
        exponent: int,
        limit: int,
    ) -> None: ...
    def start(
        self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s, root: int
    ) -> None: ...
    def separate(
        self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s, root: int
    ) -> None: ...
    def separate_rows(
        self,
        choice: int,
        structure: int,
        level: Int32s,
        low: Int32s,
        high: Int32s,
        values: Floats,
        root: int,
    ) -> None: ...
    def step(self) -> bool: ...
    def blocks_meeting(
        self, level: Int32s, low: Int32s, high: Int32s, leaves: Int32s, root: int
    ) -> NDArray[np.int64]: ...
    def first_members(self) -> tuple[NDArray[np.int64], NDArray[np.uint8]]: ...
    def diagram(self) -> tuple[Int32s, Int32s, Int32s, int]: ...
    def rows(
        self, order: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], Int32s, Floats]: ...
