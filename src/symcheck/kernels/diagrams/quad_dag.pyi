from symcheck.kernels.arrays import Floats, Int32s, Int64s

_Odd = tuple[Int32s, Int32s, Int32s, Int64s, int]

class QuadDag:
    rows: int
    columns: int
    triples: int
    nodes: int
    entries: Int64s
    def __init__(
        self,
        level: Int32s,
        low: Int32s,
        high: Int32s,
        values: Floats,
        roots: Int32s,
        row: _Odd,
        col: _Odd,
        row_levels: Int32s,
        col_levels: Int32s,
    ) -> None: ...
