from symcheck.kernels.arrays import Floats, Int32s, Int64s

class Equations:
    n: int
    mode: int
    def __init__(
        self, indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None, lower: Floats, upper: Floats, exit: Floats, mode: int
    ) -> None: ...

class Part:
    n: int
    rows: int
    entries: int
    mode: int
    row_ptr: Int64s
    group: Int64s
    row_id: Int64s
    choice: Int64s
    idx: Int32s
    val: Floats
    bl: Floats
    bh: Floats
    exit: Floats
    x: Floats
    open_: bool
    grouped: bool
    def principle(self) -> bool: ...
