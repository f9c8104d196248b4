"""Plain arrays that the numerical layer works on: sparse matrices, with rows grouped into choices for an MDP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from symcheck.kernels.arrays import Bools, Floats, Int32s, Int64s

__all__ = ["Bools", "Floats", "Int32s", "Int64s", "SparseMatrix", "spans", "starts_of"]


@dataclass(frozen=True, eq=False)
class SparseMatrix:
    """Compressed rows. Row r has columns `indices[indptr[r]:indptr[r+1]]` with `data` alike, no column twice.

    `groups` (int64[states+1]) says which rows are the choices of a state: rows groups[s] to groups[s+1]. None means
    one row per state (DTMC, CTMC). Indices are int32: more than 2**31-1 states raise OverflowError on building.
    """

    indptr: Int64s
    indices: Int32s
    data: Floats
    columns: int
    groups: Int64s | None = None

    @property
    def rows(self) -> int:
        """Number of rows (choices)."""
        return len(self.indptr) - 1

    @property
    def states(self) -> int:
        """Number of row groups (states)."""
        return self.rows if self.groups is None else len(self.groups) - 1

    @property
    def entries(self) -> int:
        """Number of stored entries."""
        return int(self.indptr[-1])

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, in bytes."""
        own = self.indptr.nbytes + self.indices.nbytes + self.data.nbytes
        return own + (0 if self.groups is None else self.groups.nbytes)


def starts_of(sizes: ArrayLike) -> Int64s:
    """Where parts of these sizes begin, one after the other, and where the last one ends: int64[n+1]."""
    sizes = np.asarray(sizes)
    out = np.zeros(len(sizes) + 1, np.int64)
    np.cumsum(sizes, out=out[1:])
    return out


def spans(starts: Int64s, ends: Int64s) -> Int64s:
    """The numbers of all half-open ranges, one after the other."""
    after = starts_of(ends - starts)
    return np.asarray(np.arange(after[-1]) + np.repeat(starts - after[:-1], ends - starts))
