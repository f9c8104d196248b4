"""Diagrams as plain arrays, for kernels that do not know CUDD.

Levels are those at the time of the export: a table is outdated after a reordering.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["BddTable", "NodeTable"]


@dataclass(frozen=True, eq=False)
class BddTable:
    """BDDs as nodes without complement edges; children come before their parents, 0 and 1 are the
    terminals.

    Attributes:
        levels: number of variables, which is also the level of the terminals.
        level, low, high: int32[N]; terminals are their own children.
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
    """MTBDDs as nodes: first the leaves, then inner nodes, children before their parents.

    Attributes:
        levels: number of variables, which is also the level of the leaves.
        level, low, high: int32[N]; leaves are their own children.
        values: float64[leaves], unordered.
        roots: int32[diagrams].
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
