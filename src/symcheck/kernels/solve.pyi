from symcheck.numerics.matrix import Floats, Int32s, Int64s

NONE: int
MIN: int
MAX: int

class Block:
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
    def interval(self, goal: float, relative: bool, budget: int) -> tuple[bool, int, float]: ...
    def optimistic(self, goal: float, relative: bool, budget: int, fresh: bool = True) -> tuple[bool, int, float]: ...
    def eliminate(self) -> bool: ...

class System:
    n: int
    mode: int
    def __init__(
        self, indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None, lower: Floats, upper: Floats, exit: Floats, mode: int
    ) -> None: ...
    def block(self, states: Int32s, x: Floats) -> Block: ...
    def store(self, block: Block, states: Int32s, x: Floats, strategy: Int64s) -> None: ...
    def sweep_acyclic(self, x: Floats, strategy: Int64s, descending: bool) -> None: ...
    def advance(
        self,
        order: Int32s,
        start: Int64s,
        component: int,
        x: Floats,
        strategy: Int64s,
        deep: Int32s,
        share: float,
        relative: bool,
        probability: bool,
        small: int,
        counters: Int64s,
    ) -> int: ...
