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

class EquationBlock:
    n: int
    rows: int
    entries: int
    mode: int
    indices: Int32s
    data: Floats
    constant_low: Floats
    constant_high: Floats
    has_exit: bool
    grouped: bool
    wide: bool
    @property
    def indptr(self) -> Int32s | Int64s: ...
    @property
    def groups(self) -> Int32s | Int64s: ...
    @property
    def policy(self) -> Int32s: ...
    @property
    def x(self) -> Floats: ...
    def exit_masses(self) -> Floats: ...
    def global_rows(self, policy: Int32s) -> Int64s: ...
