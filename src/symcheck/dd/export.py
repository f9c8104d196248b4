"""Diagrams as plain arrays, for kernels that know nothing of CUDD.

The arrays are a snapshot: `level` is the level at the time of export, so a table is stale after a reordering.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["BddTable", "NodeTable"]


@dataclass(frozen=True, eq=False)
class BddTable:
    """Sets as nodes without complement edges. Ids 0 and 1 are false and true; children come before their parents.

    level, low, high: int32[N]; the terminals have level `levels` (the number of variables) and are their own children.
    roots: int32[sets].
    """

    levels: int
    level: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    roots: NDArray[np.int32]

    @property
    def root(self) -> int:
        """The first root."""
        return int(self.roots[0])

    def __len__(self) -> int:
        return len(self.level)


@dataclass(frozen=True, eq=False)
class NodeTable:
    """MTBDDs as nodes. Ids below `leaves` are leaves with `values`; then inner nodes, children before their parents.

    level, low, high: int32[N]; leaves have level `levels` (the number of variables) and are their own children.
    values: float64[leaves], in no order. roots: int32[diagrams].
    """

    levels: int
    level: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    values: NDArray[np.float64]
    roots: NDArray[np.int32]

    @property
    def root(self) -> int:
        """The first root."""
        return int(self.roots[0])

    @property
    def leaves(self) -> int:
        """Number of leaves."""
        return len(self.values)

    def __len__(self) -> int:
        return len(self.level)
