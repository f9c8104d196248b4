"""The uniformised chain of a CTMC, and bounds on the remaining terms of a transient sum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.kernels.chains import uniformization
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import SweepOperator

__all__ = ["OccupationBounds", "UniformizedChain", "uniformize"]


@dataclass(eq=False)
class UniformizedChain:
    """P = I + Q/q, stored as rates divided by q and a diagonal, for multiplication from one side.

    q: the uniformisation rate. longest: the largest number of entries of a row. Either `matrix` or
    `operator` (whose products are divided by q here) is given.
    """

    q: float
    diagonal: Floats
    matrix: SparseMatrix | None
    operator: SweepOperator | None
    longest: int

    @property
    def entries(self) -> int:
        """Entries visited per step; 0 if only an operator is given."""
        return 0 if self.matrix is None else self.matrix.entries + self.matrix.rows

    def advance(
        self, y: Floats, z: Floats, total: Floats, weights: Floats, floor: float
    ) -> tuple[Floats, Floats, float, float, float]:
        """Make a step per weight: add weight · y to the total, then replace y by P y.

        Args:
            y, z: the vector and a buffer; both are overwritten.
            total: the sum, updated in place.
            weights: one per step.
            floor: entries up to it are ignored by the ratio bounds.

        Returns:
            The new y, the other buffer (the y before), the least and the greatest ratio of entries
            of the new y and the y before, and the largest entry.
        """
        if self.matrix is not None:
            m = self.matrix
            even, low, high, most = uniformization.uniformized_steps(
                *m.arrays, self.diagonal, y, z, total, weights, floor
            )
            return (y, z, low, high, most) if even else (z, y, low, high, most)
        assert self.operator is not None
        before = y
        for w in weights:
            if w:
                total += w * y
            before, y = y, self.operator.multiply(y) / self.q + self.diagonal * y
        with np.errstate(divide="ignore", invalid="ignore"):
            least = ((y - floor) / before)[before > floor]
            greatest = ((y + floor) / (before + floor))[(y > 0.0) | (before > 0.0)]
        return (
            y,
            before,
            float(least.min(initial=np.inf)),
            float(greatest.max(initial=0.0)),
            float(y.max(initial=0.0)),
        )


@dataclass(frozen=True, eq=False)
class OccupationBounds:
    """Bounds on the remaining terms of a transient sum from occupation times.

    time: bounds on the expected time spent in each state, from the start to the horizon,
    float64[n]. leak: the probability that P loses on the way.

    The difference of y from a level c is weighted with the occupation times. If
    y = c + above - below, the rest of the sum, with weights that fall from at most 1, lies between
    c * rest * (1 - q time·leak) - q time·below and c * rest + q time·above at the start.
    """

    time: Floats
    leak: float

    @staticmethod
    def of(chain: UniformizedChain, time: Floats) -> OccupationBounds:
        """The bounds for a chain that loses little probability."""
        assert chain.matrix is not None
        stays = chain.matrix.row_sums() + chain.diagonal
        return OccupationBounds(
            time,
            chain.q * float(time @ np.maximum(1.0 - stays, 0.0)) * (1.0 + 1e-9)
            + len(time) * tuning.UNIT_ROUNDOFF,
        )

    def level(self, y: Floats, interest: Int64s, q: float, rest: float) -> tuple[Floats, Floats]:
        """Bounds on the rest of the sum at each state of interest, from its own level."""
        pairs = [self._around_level(y, float(c), q, rest) for c in y[interest]]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])

    def settled(
        self, y: Floats, before: Floats, chain: UniformizedChain, rest: float
    ) -> tuple[float, float]:
        """A ratio r, and a bound on the error of the rest as the sum of weight_j * r^j * y.

        Let y = P before = r before + d with r <= 1. Then P^j y = r^j y + sum over i < j of
        r^(j-1-i) P^(i+1) d. Summed with the weights, the second part is at most rest * q time·|d|:
        the tail sums of a Poisson distribution are log-concave, so the rest after m >= 1 more
        steps is at most rest * P(N > m).
        """
        ahead, behind = float(self.time @ y), float(self.time @ before)
        ratio = min(1.0, ahead / behind) if behind > 0.0 else 1.0
        rounding = (chain.longest + 8) * tuning.UNIT_ROUNDOFF * (ahead + behind)
        return ratio, rest * chain.q * (
            float(self.time @ np.abs(y - ratio * before)) + rounding
        ) * (1 + 1e-9)

    def _around_level(self, y: Floats, c: float, q: float, rest: float) -> tuple[float, float]:
        """Bounds on the rest of the sum by the distance of y from a level c."""
        room = q * (1 + 1e-9)
        low = c * rest * (1.0 - self.leak) - room * float(self.time @ np.maximum(c - y, 0.0))
        return max(0.0, low), c * rest + room * float(self.time @ np.maximum(y - c, 0.0))


def uniformize(
    rates: SparseMatrix | SweepOperator, exit_rates: Floats, transposed: bool = False
) -> UniformizedChain:
    """The chain of a CTMC, uniformised at its largest exit rate.

    Args:
        rates: the rate matrix, or an operator.
        exit_rates: float64[n].
        transposed: multiply distributions instead of values (rows are needed for it).
    """
    q = float(np.max(exit_rates, initial=0.0)) or 1.0
    diagonal = 1.0 - exit_rates / q
    diagonal[diagonal < 4 * tuning.UNIT_ROUNDOFF] = 0.0
    if not isinstance(rates, SparseMatrix):
        return UniformizedChain(q, diagonal, None, rates, rates.longest)
    arrays = rates.arrays
    if transposed:
        arrays = sparse.transpose_values(*arrays, rates.columns)
    matrix = SparseMatrix(arrays[0], arrays[1], arrays[2] / q, rates.columns)
    return UniformizedChain(q, diagonal, matrix, None, matrix.longest)
