from symcheck.kernels.arrays import Floats, Int32s, Int64s

class GthElimination:
    error: float
    complete: bool
    out_of_range: bool
    operations: int
    updates: int
    def __init__(
        self, indptr: Int64s, indices: Int32s, data: Floats, exit: Floats, limit: int
    ) -> None: ...
    def solve(self, b: Floats) -> Floats: ...
    def stationary(self) -> Floats: ...
