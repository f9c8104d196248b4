"""Types of the compiled exploration."""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.hashing import StateSet

class Outcome(IntEnum):
    COMPLETE = 0
    PAUSED = ...
    BUDGET = ...
    FAULT = ...
    NO_MEMORY = ...
    TOO_MANY = ...

class Explorer:
    states: StateSet
    explored: int
    choices: int
    transitions: int
    level: int
    deadlock_count: int
    fault_status: int
    fault_state: int
    def __init__(self, tables: Any) -> None: ...
    @property
    def nbytes(self) -> int: ...
    def add(self, rows: NDArray[np.uint64]) -> None: ...
    def run(self, budget: int, seconds: float) -> Outcome: ...
    def copy_states(self, out: NDArray[np.uint64]) -> None: ...
    def copy_deadlocks(self, out: NDArray[np.int64]) -> None: ...
    def finish(
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
