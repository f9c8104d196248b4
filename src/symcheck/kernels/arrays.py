"""The types of the arrays that compiled loops take and give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Bools",
    "Diagram",
    "Floats",
    "Floats32",
    "Int32s",
    "Int64s",
    "Masks",
    "NewDiagram",
    "OddTable",
    "UInt16s",
    "Words",
]

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Words = NDArray[np.uint64]
UInt16s = NDArray[np.uint16]
Int64s = NDArray[np.int64]
Int32s = NDArray[np.int32]
Bools = NDArray[np.bool_]
Masks = NDArray[np.uint8]
"""0 or 1 for each state or row, or bytes that hold a bit for each."""

OddTable = tuple[Int32s, Int32s, Int32s, Int64s, int]
"""An ODD (see `symcheck.kernels.diagrams.odd`): depth, low, high, count and the root."""
Diagram = tuple[Int32s, Int32s, Int32s, Floats, int]
"""A diagram: level, low, high, the values of the leaves, and the root."""
NewDiagram = tuple[Int32s, Int32s, Int32s, int]
"""A diagram without values: level, low, high and the root."""
