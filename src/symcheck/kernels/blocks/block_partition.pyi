from collections.abc import Mapping

from symcheck.kernels.arrays import Int64s
from symcheck.kernels.diagrams.quad_dag import Quad

class Cut:
    rows: int
    columns: int
    roots: int
    parts: int
    threshold: int
    entries: Int64s
    part_rows: Int64s
    part_work: Int64s
    def __init__(
        self, quad: Quad, budget: int, ordered: bool = False, range_rows: int = 32768
    ) -> None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def statistics(self) -> Mapping[str, int]: ...
    def listing(self) -> tuple[Int64s, Int64s]: ...
