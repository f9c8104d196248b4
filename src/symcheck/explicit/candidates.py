"""Decision forests that find the commands which may be enabled, given the values of a few
variables.

In a model with hundreds of commands, one variable usually tells where each module stands (`s=3`,
`count=7`). A conjunct of a guard that reads a single variable rules the command out for some of its
values. A branch on the variable that rules out most leaves a few candidates, whose guards are then
evaluated in full.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from symcheck.explicit import tuning
from symcheck.matrices.rows import Bools
from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import conjuncts, names

__all__ = ["Forest", "Masks", "all_of", "any_of", "guard_masks"]

Masks = Mapping[int, Bools]


def guard_masks(
    guard: Expression, variables: tuple[Variable, ...], index: Mapping[str, int]
) -> Masks:
    """Per variable, the values for which no conjunct that reads only this variable is false.

    Returns:
        Variable index to bool[high - low + 1].
    """
    masks: dict[int, Bools] = {}
    for part in conjuncts(guard):
        v = _single(part, index)
        if v is None:
            continue
        domain = variables[v].domain
        if domain is None or not 1 < len(domain) <= tuning.MAX_SWITCH_VALUES:
            continue
        lanes = evaluate_columns(part, {variables[v].name: np.asarray(domain)})
        # A value without a result is kept: the full guard reports the fault.
        mask = lanes.values if lanes.faults is None else lanes.values | lanes.faults
        masks[v] = masks[v] & mask if v in masks else mask
    return masks


def _single(part: Expression, index: Mapping[str, int]) -> int | None:
    """The only variable that an expression reads, if there is exactly one."""
    read = names(part)
    return index[read.pop()] if len(read) == 1 else None


def any_of(alternatives: Sequence[Masks]) -> Masks:
    """The masks of a disjunction: values that at least one of the alternatives allows."""
    shared = reduce(lambda a, b: a & b, (set(m) for m in alternatives)) if alternatives else set()
    return {v: reduce(np.logical_or, [m[v] for m in alternatives]) for v in shared}


def all_of(parts: Sequence[Masks]) -> Masks:
    """The masks of a conjunction: values that all parts allow."""
    masks: dict[int, Bools] = {}
    for part in parts:
        for v, mask in part.items():
            masks[v] = masks[v] & mask if v in masks else mask
    return masks


class Forest:
    """Builds decision forests in one int32 array.

    Nodes are (0, n, items …), or (1, variable, low, next, children …) with -1 for no child.

    Args:
        lows: lower bounds of the variables.
    """

    def __init__(self, lows: Sequence[int]) -> None:
        self._lows = lows
        self._nodes: list[int] = []
        self._known: dict[tuple[int, ...], int] = {}

    def array(self) -> NDArray[np.int32]:
        """All forests, one after the other: int32[n]."""
        return np.array(self._nodes or [0, 0], np.int32)

    def add(self, items: Sequence[int], masks_of: Sequence[Masks]) -> int:
        """Add a forest that finds the items which their masks allow; returns its root, or -1 if
        there are no items.

        masks_of: the masks of each item, in the same order.
        """
        self._known = {}
        self._masks = dict(zip(items, masks_of, strict=True))
        return self._build(tuple(items), frozenset(), tuning.MAX_FOREST_DEPTH)

    def _build(self, items: tuple[int, ...], used: frozenset[int], depth: int) -> int:
        if not items:
            return -1
        key = (*sorted(used), -1, *items)
        if key not in self._known:
            self._known[key] = self._node(items, used, depth)
        return self._known[key]

    def _node(self, items: tuple[int, ...], used: frozenset[int], depth: int) -> int:
        variable = self._best(items, used) if len(items) > tuning.MAX_LEAF_ITEMS and depth else None
        if variable is None:
            return self._append([0, len(items), *items])
        group = [i for i in items if self._selective(i, variable)]
        rest = tuple(i for i in items if not self._selective(i, variable))
        allowed = np.stack([self._masks[i][variable] for i in group])
        below = [
            tuple(np.array(group)[allowed[:, value]].tolist()) for value in range(allowed.shape[1])
        ]
        children = [self._build(b, used | {variable}, depth - 1) for b in below]
        following = self._build(rest, used | {variable}, depth)
        return self._append([1, variable, self._lows[variable], following, *children])

    def _append(self, node: list[int]) -> int:
        self._nodes.extend(node)
        return len(self._nodes) - len(node)

    def _selective(self, item: int, variable: int) -> bool:
        mask = self._masks[item].get(variable)
        return mask is not None and bool(mask.mean() <= tuning.MAX_MASK_SHARE)

    def _best(self, items: tuple[int, ...], used: frozenset[int]) -> int | None:
        """The variable whose values rule out most items; None if none rules out enough."""
        gain: dict[int, float] = {}
        for i in items:
            for v, mask in self._masks[i].items():
                share = float(mask.mean())
                if v not in used and share <= tuning.MAX_MASK_SHARE:
                    gain[v] = gain.get(v, 0.0) + 1 - share
        best = max(gain, key=lambda v: gain[v], default=None)
        return best if best is not None and gain[best] > tuning.MIN_SWITCH_GAIN else None
