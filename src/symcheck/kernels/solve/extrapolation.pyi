from symcheck.kernels.arrays import Floats, Int32s, Int64s

class Candidate:
    x: Floats
    choice: Int32s
    n: int
    sweeps: int
    mode: int
    def __init__(
        self,
        ptr: Int32s | Int64s,
        idx: Int32s,
        val: Floats,
        groups: Int32s | Int64s | None,
        low: Floats,
        high: Floats,
        mode: int,
        relative: bool,
    ) -> None: ...
    def improve(self, rounds: int = 1) -> tuple[float, int]: ...
    def rest(self) -> None: ...
    def take(self, policy: Int32s) -> None: ...
    def evaluate(self, tolerance: float, steps: int) -> float: ...
    def bound(self, y: Floats, upper: bool, rounds: int, policy: Int32s) -> int: ...
