from symcheck.kernels.arrays import Floats, Int32s, Int64s

class PolicyEvaluator:
    x: Floats
    policy: Int32s
    n: int
    sweeps: int
    mode: int
    def __init__(
        self,
        indptr: Int32s | Int64s,
        indices: Int32s,
        data: Floats,
        groups: Int32s | Int64s | None,
        low: Floats,
        high: Floats,
        mode: int,
        relative: bool,
    ) -> None: ...
    def improve(self, rounds: int = 1) -> tuple[float, int]: ...
    def release_history(self) -> None: ...
    def set_policy(self, policy: Int32s) -> None: ...
    def evaluate(self, tolerance: float, steps: int) -> float: ...
    def verify_bound(self, y: Floats, upper: bool, rounds: int, policy: Int32s) -> int: ...
