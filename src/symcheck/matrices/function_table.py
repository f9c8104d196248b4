"""Distinct rational functions by number, so that arrays of them are arrays of ints."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from symcheck.kernels.arrays import Int64s
from symcheck.matrices.numbers import Rationals
from symcheck.matrices.rational_functions import RationalFunction

__all__ = ["FunctionTable", "run_starts"]


def run_starts(*keys: Int64s) -> Int64s:
    """Where runs of equal keys begin, in arrays that are sorted by them."""
    differs = np.ones(len(keys[0]), bool)
    differs[1:] = np.any([key[1:] != key[:-1] for key in keys], axis=0)
    return np.flatnonzero(differs)


class FunctionTable:
    """Distinct functions, in the order in which they were numbered."""

    def __init__(self, functions: Iterable[RationalFunction] = ()) -> None:
        self.functions: list[RationalFunction] = []
        self._numbers: dict[RationalFunction, int] = {}
        self._sums: dict[tuple[int, ...], int] = {}
        self.numbers(functions)

    def number(self, function: RationalFunction) -> int:
        """The number of a function, which may be new."""
        known = self._numbers.setdefault(function, len(self.functions))
        if known == len(self.functions):
            self.functions.append(function)
        return known

    def numbers(self, functions: Iterable[RationalFunction]) -> Int64s:
        """The numbers of functions: int64[n]."""
        return np.array([*map(self.number, functions)], np.int64)

    def of(self, numbers: Int64s) -> Rationals:
        """The functions with these numbers."""
        table = np.empty(len(self.functions), object)
        table[:] = self.functions
        return table[numbers]

    def sums(self, numbers: Int64s, starts: Int64s) -> Int64s:
        """The sum of each run of numbers; runs are not empty. Equal runs are added once."""
        out = numbers[starts]
        ends = np.append(starts[1:], len(numbers))
        for i in np.flatnonzero(ends - starts > 1).tolist():
            key = tuple(sorted(numbers[starts[i] : ends[i]].tolist()))
            if key not in self._sums:
                first, *others = (self.functions[k] for k in key)
                self._sums[key] = self.number(sum(others, first))
            out[i] = self._sums[key]
        return out

    def merged(self, row: Int64s, column: Int64s, numbers: Int64s) -> tuple[Int64s, Int64s, Int64s]:
        """The entries of a matrix in the order of their places; those of one place are added."""
        order = np.lexsort((column, row))
        row, column, numbers = row[order], column[order], numbers[order]
        first = run_starts(row, column)
        return row[first], column[first], self.sums(numbers, first)

    def pairs(
        self,
        operation: Callable[[RationalFunction, RationalFunction], RationalFunction],
        a: Int64s,
        b: Int64s,
    ) -> Int64s:
        """An operation on two functions each; equal pairs are computed once."""
        size = len(self.functions)
        distinct, inverse = np.unique(a * size + b, return_inverse=True)
        found = [
            self.number(operation(self.functions[i // size], self.functions[i % size]))
            for i in distinct.tolist()
        ]
        return np.array(found, np.int64)[inverse]
