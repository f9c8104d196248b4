"""Rows of intervals of probabilities: a matrix of lower ends and one of upper ends.

Source: Givan, Leach & Dean (2000), 'Bounded-parameter Markov decision processes'.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from symcheck.direction import Direction
from symcheck.kernels.solve import intervals as kernel
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix

__all__ = ["IntervalRows"]

_UNIT = 2.0**-53


@dataclass(frozen=True, eq=False)
class IntervalRows:
    """The distributions with lower <= p <= upper in each row, of which nature chooses one.

    Attributes:
        lower: the lower ends.
        upper: the upper ends, in the places of the lower ones.
        nature: nature minimises or maximises expectations.
        error: of sums of ends of a row, relative.
    """

    lower: SparseMatrix
    upper: Numbers
    nature: Direction
    error: float = 0.0

    @property
    def longest(self) -> int:
        """The largest number of entries of a row."""
        return self.lower.longest

    @property
    def is_rational(self) -> bool:
        """Whether the ends are rationals."""
        return self.lower.is_rational

    @property
    def compiled(self) -> kernel.IntervalRows:
        """The rows of doubles for compiled loops."""
        indptr, indices, lower = self.lower.arrays
        greatest = self.nature is Direction.MAX
        return kernel.IntervalRows(indptr, indices, lower, self.upper, greatest, self.error)

    def multiply(self, x: Numbers) -> Numbers:
        """The best expectation of x, a number per state, by each row."""
        if self.is_rational:
            return self.chosen(x).multiply(x)
        return self.compiled.multiply(x, False)

    def chosen(self, x: Numbers) -> SparseMatrix:
        """The distributions that nature chooses for the values x, a number per column."""
        data, sign = self.lower.data.copy(), -1 if self.nature is Direction.MAX else 1
        values = (sign * x).tolist()
        indices, starts = self.lower.indices.tolist(), self.lower.indptr.tolist()
        for begin, end in pairwise(starts):
            rest = 1 - sum(data[begin:end].tolist())
            for e in sorted(range(begin, end), key=lambda e: values[indices[e]]):
                if rest <= 0:
                    break
                share = min(rest, self.upper[e] - data[e])
                data[e] += share
                rest -= share
        return replace(self.lower, data=data)

    def choose(self, rows: Int64s, groups: Int64s, column_of: Int32s, columns: int) -> IntervalRows:
        """Some rows, with columns renumbered (many to one); intervals that coincide are added.

        States with equal values may have a common column: it receives what is between the sums.
        """
        lower = self.lower.choose(rows, groups)
        upper = replace(self.lower, data=self.upper).choose(rows, groups)
        merged = lower.merge(column_of, columns)
        error = self.error + self.longest * _UNIT
        return IntervalRows(merged, upper.merge(column_of, columns).data, self.nature, error)

    def doubles(self) -> IntervalRows:
        """The rows with the nearest doubles."""
        upper = replace(self.lower, data=self.upper).doubles().data
        return IntervalRows(self.lower.doubles(), upper, self.nature, _UNIT)
