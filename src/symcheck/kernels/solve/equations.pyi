from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

class Equations:
    n: int
    mode: int
    def __init__(
        self,
        indptr: Int64s,
        indices: Int32s,
        data: Floats,
        groups: Int64s | None,
        lower: Floats | None,
        upper: Floats | None,
        exit: Floats | None,
        mode: int,
        unknown: Masks | None = None,
        rates: bool = False,
    ) -> None: ...

class Part:
    n: int
    rows: int
    entries: int
    mode: int
    idx: Int32s
    val: Floats
    bl: Floats
    bh: Floats
    open_: bool
    grouped: bool
    wide: bool
    @property
    def row_ptr(self) -> Int32s | Int64s: ...
    @property
    def group(self) -> Int32s | Int64s: ...
    @property
    def choice(self) -> Int32s: ...
    @property
    def x(self) -> Floats: ...
    def leaving(self) -> Floats: ...
    def chosen(self, choice: Int32s) -> Int64s: ...
