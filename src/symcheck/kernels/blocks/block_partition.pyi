from collections.abc import Mapping

from symcheck.kernels.arrays import Int64s
from symcheck.kernels.diagrams.quad_dag import QuadDag

class BlockPartition:
    rows: int
    columns: int
    roots: int
    ranges: int
    threshold: int
    entries: Int64s
    range_bounds: Int64s
    range_work: Int64s
    def __init__(
        self, dag: QuadDag, budget: int, ordered: bool = False, range_rows: int = 32768
    ) -> None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def statistics(self) -> Mapping[str, int]: ...
    def describe(self) -> tuple[Int64s, Int64s]: ...
