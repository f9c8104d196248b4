from symcheck.kernels.arrays import Bools, Floats, Int32s, Int64s, Masks
from symcheck.kernels.blocks.block_partition import BlockPartition

class BlockOperations(BlockPartition):
    def multiply(self, root: int, x: Floats, y: Floats, first: int = 0, last: int = -1) -> None: ...
    def multiply_choices(
        self,
        x: Floats,
        groups: Int64s,
        present: Masks,
        out: Floats,
        first: int = 0,
        last: int = -1,
    ) -> None: ...
    def optimum(
        self,
        x: Floats,
        constant: Floats,
        groups: Int64s,
        present: Masks,
        greatest: bool,
        out: Floats,
        first: int = 0,
        last: int = -1,
    ) -> None: ...
    def sweep(
        self,
        x: Floats,
        constant: Floats,
        divisor: Floats,
        groups: Int64s | None,
        present: Masks | None,
        greatest: bool,
        upper: bool,
        rounding_error: float,
        order: Int32s,
        repetitions: int,
    ) -> float: ...
    def range_dependencies(self) -> Bools: ...
    def multiply_transposed(self, root: int, x: Floats, y: Floats) -> None: ...
    def diagonal(self, root: int, out: Floats) -> None: ...
    def count_entries(self, root: int, counts: Int32s) -> None: ...
    def count_choice_entries(self, groups: Int64s, present: Masks, counts: Int64s) -> bool: ...
    def fill_rows(self, root: int, next_entry: Int64s, indices: Int32s, data: Floats) -> None: ...
    def single_columns(self, root: int, out: Int32s) -> None: ...
