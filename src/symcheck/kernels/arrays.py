"""The types of the arrays that compiled loops take and give."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bools", "Floats", "Int32s", "Int64s", "Masks"]

Floats = NDArray[np.float64]
Int64s = NDArray[np.int64]
Int32s = NDArray[np.int32]
Bools = NDArray[np.bool_]
Masks = NDArray[np.uint8]
"""0 or 1 for each state or row, or bytes that hold a bit for each."""
