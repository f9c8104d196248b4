"""Boolean functions as reduced ordered binary decision diagrams (Bryant 1986), in plain Python.

A function is an int: 0 is false, 1 is true. Variables are ints, here the numbers of LTL formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

__all__ = ["FALSE", "TRUE", "BooleanFunctions"]

FALSE = 0
TRUE = 1


class BooleanFunctions:
    """A unique table of BDD nodes. Equal functions are equal ints."""

    def __init__(self) -> None:
        self._nodes: list[tuple[int, int, int]] = [(-1, 0, 0), (-1, 1, 1)]
        self._unique: dict[tuple[int, int, int], int] = {}
        self._supports: list[frozenset[int]] = [frozenset(), frozenset()]
        self.ite = cache(self._ite)

    def __len__(self) -> int:
        return len(self._nodes)

    def variable(self, number: int) -> int:
        """The function whose value is that of the variable."""
        return self._make(number, FALSE, TRUE)

    def _make(self, variable: int, low: int, high: int) -> int:
        if low == high:
            return low
        node = (variable, low, high)
        if node not in self._unique:
            self._unique[node] = len(self._nodes)
            self._nodes.append(node)
            self._supports.append(self._supports[low] | self._supports[high] | {variable})
        return self._unique[node]

    def _ite(self, f: int, g: int, h: int) -> int:
        """If f then g else h. Variables with higher numbers are closer to the root."""
        if f == TRUE or g == h:
            return g
        if f == FALSE:
            return h
        if g == TRUE and h == FALSE:
            return f
        top = max(self._nodes[x][0] for x in (f, g, h))
        low, high = zip(*(self._children(x, top) for x in (f, g, h)), strict=True)
        return self._make(top, self.ite(*low), self.ite(*high))

    def _children(self, f: int, variable: int) -> tuple[int, int]:
        node = self._nodes[f]
        return (node[1], node[2]) if node[0] == variable else (f, f)

    def conjunction(self, f: int, g: int) -> int:
        """F and g."""
        return self.ite(f, g, FALSE)

    def disjunction(self, f: int, g: int) -> int:
        """F or g."""
        return self.ite(f, TRUE, g)

    def negation(self, f: int) -> int:
        """The complement of f."""
        return self.ite(f, FALSE, TRUE)

    def support(self, f: int) -> frozenset[int]:
        """The variables that f depends on."""
        return self._supports[f]

    def substitute(self, f: int, by: Callable[[int], int]) -> int:
        """The function f with every variable v replaced by the function `by(v)`."""

        @cache
        def substituted(g: int) -> int:
            if g <= TRUE:
                return g
            variable, low, high = self._nodes[g]
            return self.ite(by(variable), substituted(high), substituted(low))

        return substituted(f)

    def cofactor(self, f: int, variable: int, value: bool) -> int:
        """The cofactor of f: the variable is replaced by a constant."""
        return self.substitute(f, lambda v: int(value) if v == variable else self.variable(v))
