from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

_Odd = tuple[Int32s, Int32s, Int32s, Int64s, int]
_Diagram = tuple[Int32s, Int32s, Int32s, Floats, int]
_NewDiagram = tuple[Int32s, Int32s, Int32s, int]

def lookup(diagram: _Diagram, column_of_level: Int32s, bits: Masks, out: Floats) -> None: ...
def diagram_to_array(odd: _Odd, diagram: _Diagram, levels: Int32s, out: NDArray[Any]) -> None: ...
def mask_to_diagram(
    odd: _Odd, bits: NDArray[np.uint64], levels: Int32s, bottom: int
) -> _NewDiagram: ...
def number_values(values: Floats, ids: Int32s) -> Floats: ...
def array_to_diagram(
    odd: _Odd, ids: Int32s, leaves: int, levels: Int32s, bottom: int
) -> _NewDiagram: ...
