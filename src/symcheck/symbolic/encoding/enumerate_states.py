"""The members of a set as rows of bits, enumerated level by level with numpy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["enumerate_states"]


def enumerate_states(
    manager: DiagramManager, states: Bdd, bits: Sequence[str], limit: int | None = None
) -> NDArray[np.uint8]:
    """The assignments in a set, in lexicographic order; time and memory are O(n k).

    Args:
        bits: k variables in diagram order, on which alone the set depends.
        limit: return at most this many, the first ones.

    Returns:
        uint8[n, k].
    """
    table = manager.export_bdd(states)
    level, low, high = table.level, table.low, table.high
    nodes = np.array([table.root] if table.root else [], dtype=np.int64)
    history: list[tuple[NDArray[np.int64], NDArray[np.uint8]]] = []
    for bit in bits:
        here = level[nodes] == manager.level_of(bit)
        children = np.stack(
            [np.where(here, low[nodes], nodes), np.where(here, high[nodes], nodes)], axis=1
        ).reshape(-1)
        # Every partial row can be completed, so the first `limit` partial rows suffice.
        kept = np.flatnonzero(children)[:limit]
        history.append((kept >> 1, (kept & 1).astype(np.uint8)))
        nodes = children[kept]
    rows = np.empty((len(nodes), len(bits)), dtype=np.uint8)
    index = np.arange(len(nodes))
    for k in range(len(bits) - 1, -1, -1):
        parents, values = history[k]
        rows[:, k] = values[index]
        index = parents[index]
    return rows
