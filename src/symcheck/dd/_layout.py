"""Tables and rows over variables in any order, brought into the manager's order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.cudd.extension import Core

__all__ = ["dense", "rows"]


def _places(core: Core, indices: tuple[int, ...]) -> tuple[NDArray[np.int32], list[int] | None]:
    """The variables by level, and where each was before (None: they were in order)."""
    places = sorted(range(len(indices)), key=lambda i: core.level(indices[i]))
    order = np.array([indices[i] for i in places], dtype=np.int32)
    return order, None if places == list(range(len(indices))) else places


def dense(
    core: Core, indices: tuple[int, ...], values: NDArray[Any]
) -> tuple[NDArray[np.int32], NDArray[Any]]:
    """A table of 2**k values with its variables in level order."""
    if values.shape != (1 << len(indices),):
        raise ValueError(
            f"a table over {len(indices)} variables needs {1 << len(indices)} values, not {values.shape}"
        )
    order, places = _places(core, indices)
    if places is not None:
        values = values.reshape((2,) * len(indices)).transpose(places).reshape(-1)
    return order, np.ascontiguousarray(values)


def rows(
    core: Core, indices: tuple[int, ...], given: NDArray[Any]
) -> tuple[NDArray[np.int32], NDArray[Any], NDArray[np.int64] | None]:
    """Sorted rows with their variables in level order, and the places of these rows in `given` (None: the same)."""
    order, places = _places(core, indices)
    k = len(indices)
    if given.ndim == 1:
        words = np.ascontiguousarray(given, dtype=np.uint64)
        if places is None:
            return order, words, None
        moved = np.zeros_like(words)
        for new, old in enumerate(places):
            moved |= (words >> np.uint64(k - 1 - old) & np.uint64(1)) << np.uint64(k - 1 - new)
    else:
        bits = np.ascontiguousarray(given, dtype=np.uint8)
        if places is None:
            return order, bits, None
        moved = np.ascontiguousarray(bits[:, places])
    keys = moved if moved.ndim == 1 else np.packbits(moved, axis=1).view(f"S{(k + 7) // 8}")[:, 0]
    sorting = np.argsort(keys, kind="stable")
    return order, np.ascontiguousarray(moved[sorting]), sorting
