"""Tables and rows over variables in any order, permuted into the order of the manager's levels."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.cudd.extension import Core

__all__ = ["rows_in_level_order", "table_in_level_order"]

S = TypeVar("S", bound=np.generic)


def _permutation(
    core: Core, indices: tuple[int, ...]
) -> tuple[NDArray[np.int32], list[int] | None]:
    """The variables by level, and the former position of each (None: they were in order)."""
    permutation = sorted(range(len(indices)), key=lambda i: core.level(indices[i]))
    order = np.array([indices[i] for i in permutation], dtype=np.int32)
    return order, None if permutation == list(range(len(indices))) else permutation


def table_in_level_order(
    core: Core, indices: tuple[int, ...], values: NDArray[S]
) -> tuple[NDArray[np.int32], NDArray[S]]:
    """The variables in level order, and the table of 2**k values over them. Raises ValueError for a
    wrong length.
    """
    if values.shape != (1 << len(indices),):
        raise ValueError(
            f"a table over {len(indices)} variables needs {1 << len(indices)} values, "
            f"not {values.shape}"
        )
    order, permutation = _permutation(core, indices)
    if permutation is not None:
        values = values.reshape((2,) * len(indices)).transpose(permutation).reshape(-1)
    return order, np.ascontiguousarray(values)


def rows_in_level_order(
    core: Core, indices: tuple[int, ...], rows: NDArray[np.uint8]
) -> tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.int64] | None]:
    """The variables in level order, the rows over them in ascending order, and the former index of
    each row.

    rows: uint8[n, k], as in `DiagramManager.bdd_from_rows`. The former indices are
    None where rows stayed.
    """
    order, permutation = _permutation(core, indices)
    bits = np.ascontiguousarray(rows, dtype=np.uint8)
    if permutation is None:
        return order, bits, None
    moved = np.ascontiguousarray(bits[:, permutation])
    keys = np.packbits(moved, axis=1).view(f"S{(len(indices) + 7) // 8}")[:, 0]
    sorting = np.argsort(keys, kind="stable")
    return order, np.ascontiguousarray(moved[sorting]), sorting
