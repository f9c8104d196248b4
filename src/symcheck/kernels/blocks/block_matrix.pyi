import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.blocks.block_partition import Cut

_Int32s = NDArray[np.int32]
_Int64s = NDArray[np.int64]
_Floats = NDArray[np.float64]
_Bytes = NDArray[np.uint8]

class Blocks(Cut):
    def multiply(
        self, root: int, x: _Floats, y: _Floats, first: int = 0, last: int = -1
    ) -> None: ...
    def multiply_choices(
        self,
        x: _Floats,
        groups: _Int64s,
        present: _Bytes,
        out: _Floats,
        first: int = 0,
        last: int = -1,
    ) -> None: ...
    def optimum(
        self,
        x: _Floats,
        constant: _Floats,
        groups: _Int64s,
        present: _Bytes,
        greatest: bool,
        out: _Floats,
        first: int = 0,
        last: int = -1,
    ) -> None: ...
    def sweep(
        self,
        x: _Floats,
        constant: _Floats,
        divisor: _Floats,
        groups: _Int64s | None,
        present: _Bytes | None,
        greatest: bool,
        upper: bool,
        slip: float,
        order: _Int32s,
        inner: int,
    ) -> float: ...
    def uses(self) -> NDArray[np.bool_]: ...
    def multiply_transposed(self, root: int, x: _Floats, y: _Floats) -> None: ...
    def diagonal(self, root: int, out: _Floats) -> None: ...
    def count_rows(self, root: int, counts: _Int32s) -> None: ...
    def count_choices(self, groups: _Int64s, present: _Bytes, counts: _Int64s) -> bool: ...
    def fill(self, root: int, following: _Int64s, indices: _Int32s, data: _Floats) -> None: ...
    def columns_of(self, root: int, out: _Int32s) -> None: ...
