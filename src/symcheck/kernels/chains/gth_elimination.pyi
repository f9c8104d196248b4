from symcheck.kernels.arrays import Floats, Int32s, Int64s

class Elimination:
    error: float
    complete: bool
    lost: bool
    operations: int
    updates: int
    def __init__(
        self, indptr: Int64s, indices: Int32s, data: Floats, exit: Floats, limit: int
    ) -> None: ...
    def solve(self, right: Floats) -> Floats: ...
    def stationary(self) -> Floats: ...
