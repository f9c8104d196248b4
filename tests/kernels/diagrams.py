"""A very small diagram builder for tests: hash-consed nodes, built from functions or dense tables by definition."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

LEAF = 10**6


class Builder:
    """Nodes as lists; children before parents."""

    def __init__(self) -> None:
        self.level: list[int] = []
        self.low: list[int] = []
        self.high: list[int] = []
        self.value: list[float] = []
        self.unique: dict[tuple[object, ...], int] = {}

    def _add(self, key: tuple[object, ...], level: int, low: int, high: int, value: float) -> int:
        if key not in self.unique:
            self.unique[key] = len(self.level)
            self.level.append(level)
            self.low.append(low)
            self.high.append(high)
            self.value.append(value)
        return self.unique[key]

    def leaf(self, value: float) -> int:
        return self._add(("leaf", float(value)), LEAF, -1, -1, float(value))

    def node(self, level: int, low: int, high: int) -> int:
        return low if low == high else self._add((level, low, high), level, low, high, 0.0)

    def dense(self, levels: Sequence[int], values: np.ndarray) -> int:
        """The diagram of an array of 2**k values, the first level being the most significant bit."""
        if not levels:
            return self.leaf(values[0])
        half = len(values) // 2
        return self.node(
            levels[0], self.dense(levels[1:], values[:half]), self.dense(levels[1:], values[half:])
        )

    def apply(self, op: Callable[[float, float], float], a: int, b: int) -> int:
        memo: dict[tuple[int, int], int] = {}

        def go(a: int, b: int) -> int:
            if (a, b) not in memo:
                level = min(self.level[a], self.level[b])
                if level == LEAF:
                    memo[a, b] = self.leaf(op(self.value[a], self.value[b]))
                else:
                    a0, a1 = (self.low[a], self.high[a]) if self.level[a] == level else (a, a)
                    b0, b1 = (self.low[b], self.high[b]) if self.level[b] == level else (b, b)
                    memo[a, b] = self.node(level, go(a0, b0), go(a1, b1))
            return memo[a, b]

        return go(a, b)

    def evaluate(self, node: int, bits: dict[int, int]) -> float:
        while self.low[node] >= 0:
            node = self.high[node] if bits[self.level[node]] else self.low[node]
        return self.value[node]

    def arrays(
        self, *roots: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(level, low, high, value, roots) with the leaves first and their own children, as the kernels take them."""
        order = sorted(range(len(self.level)), key=lambda i: self.low[i] >= 0)
        place = {node: i for i, node in enumerate(order)}
        place[-1] = -1
        low, high = (
            np.array([place[x[i]] for i in order], np.int32) for x in (self.low, self.high)
        )
        values = np.array([self.value[i] for i in order if self.low[i] < 0])
        low[: len(values)] = high[: len(values)] = np.arange(len(values))
        return (
            np.array([self.level[i] for i in order], np.int32),
            low,
            high,
            values,
            np.array([place[r] for r in roots], np.int32),
        )


def points(k: int) -> np.ndarray:
    """All bit vectors of length k in lexicographic order, uint8[2**k, k]."""
    return np.array(list(product((0, 1), repeat=k)), np.uint8).reshape(2**k, k)
