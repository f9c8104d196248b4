"""Boolean functions as reduced ordered binary decision diagrams (Bryant 1986), in plain Python.

A function is an int: 0 is false, 1 is true. Variables are ints, here the numbers of LTL formulas.
"""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["FALSE", "TRUE", "BooleanFunctions"]

FALSE = 0
TRUE = 1


class BooleanFunctions:
    """A unique table of BDD nodes. Equal functions are equal ints."""

    def __init__(self) -> None:
        self._nodes: list[tuple[int, int, int]] = [(-1, 0, 0), (-1, 1, 1)]
        self._unique: dict[tuple[int, int, int], int] = {}
        self._cache: dict[tuple[int, int, int], int] = {}
        self._supports: dict[int, frozenset[int]] = {FALSE: frozenset(), TRUE: frozenset()}

    def __len__(self) -> int:
        return len(self._nodes)

    def variable(self, number: int) -> int:
        """The function whose value is that of the variable."""
        return self._make(number, FALSE, TRUE)

    def _make(self, variable: int, low: int, high: int) -> int:
        if low == high:
            return low
        key = (variable, low, high)
        found = self._unique.get(key)
        if found is None:
            found = len(self._nodes)
            self._nodes.append(key)
            self._unique[key] = found
            self._supports[found] = self._supports[low] | self._supports[high] | {variable}
        return found

    def ite(self, f: int, g: int, h: int) -> int:
        """If f then g else h. Variables with higher numbers are closer to the root."""
        if f == TRUE or g == h:
            return g
        if f == FALSE:
            return h
        if g == TRUE and h == FALSE:
            return f
        key = (f, g, h)
        found = self._cache.get(key)
        if found is None:
            top = max(self._nodes[f][0], self._nodes[g][0], self._nodes[h][0])
            low, high = zip(*(self._children(x, top) for x in key), strict=True)
            found = self._make(top, self.ite(*low), self.ite(*high))
            self._cache[key] = found
        return found

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

    def substitute(
        self, f: int, by: Callable[[int], int], memo: dict[int, int] | None = None
    ) -> int:
        """The function f with every variable v replaced by the function `by(v)`.

        memo: results to reuse; it may be shared by calls with the same `by`.
        """
        memo = {} if memo is None else memo
        if f <= TRUE:
            return f
        found = memo.get(f)
        if found is None:
            variable, low, high = self._nodes[f]
            found = self.ite(
                by(variable), self.substitute(high, by, memo), self.substitute(low, by, memo)
            )
            memo[f] = found
        return found

    def cofactor(self, f: int, variable: int, value: bool) -> int:
        """The cofactor of f: the variable is replaced by a constant."""
        return self.substitute(
            f, lambda v: (TRUE if value else FALSE) if v == variable else self.variable(v)
        )
