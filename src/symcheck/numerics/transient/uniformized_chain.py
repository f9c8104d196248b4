"""A CTMC at its fastest rate: the chain that uniformisation steps through, and what is left to come when it has settled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.kernels.chains import uniformization
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics.linear.problem import SweepOperator

__all__ = ["ROUND", "Chain", "Visits", "uniformise"]

ROUND = 2.0**-53


@dataclass(eq=False)
class Chain:
    """P = off-diagonal rows / q + diagonal, for one direction of multiplication; `longest`: terms of a row at most."""

    q: float
    diagonal: Floats
    matrix: SparseMatrix | None
    operator: SweepOperator | None
    longest: int

    @property
    def entries(self) -> int:
        """Of the matrix (0 where it is not known)."""
        return 0 if self.matrix is None else self.matrix.entries + self.matrix.rows

    def advance(
        self, y: Floats, z: Floats, total: Floats, weights: Floats, floor: float
    ) -> tuple[Floats, Floats, float, float, float]:
        """Accumulate and step once per weight; the new y, the other buffer, ratio bounds and the greatest entry."""
        if self.matrix is not None:
            m = self.matrix
            even, low, high, most = uniformization.steps(
                m.indptr, m.indices, m.data, self.diagonal, y, z, total, weights, floor
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
class Visits:
    """Bounds on the time spent in each state from where one starts, up to the horizon: what differs from a level matters so much.

    If y = c + above - below then what remains, sum over j of weight_j P^j y with weights that fall from at most 1, lies between
    c * rest * (1 - q time·leak) - q time·below and c * rest + q time·above at the start, where leak is what P loses per step.
    """

    time: Floats
    leak: float
    patience: int = 1000

    @staticmethod
    def of(chain: Chain, time: Floats) -> Visits:
        """For a chain with few losses on the way."""
        assert chain.matrix is not None
        stays = sparse.row_sums(chain.matrix.indptr, chain.matrix.data) + chain.diagonal
        return Visits(
            time,
            chain.q * float(time @ np.maximum(1.0 - stays, 0.0)) * (1.0 + 1e-9) + len(time) * ROUND,
        )

    def level(self, y: Floats, interest: Int64s, q: float, rest: float) -> tuple[Floats, Floats]:
        """Bounds on what remains, at each state of interest."""
        pairs = [self.around(y, float(c), 1.0, q, rest) for c in y[interest]]
        return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])

    def settled(self, y: Floats, before: Floats, chain: Chain, rest: float) -> tuple[float, float]:
        """(r, off): what remains, from where one starts, is the sum of weight_j * r^j * y there, up to `off`.

        With y = P before = r before + d and r <= 1, P^j y = r^j y + sum over i < j of r^(j-1-i) P^(i+1) d. Summed with the weights,
        the second part is at most rest * q time·|d|: the sums of the tails of a Poisson distribution are log-concave, so that what
        rests m >= 1 steps later on is at most rest * P(N > m).
        """
        ahead, behind = float(self.time @ y), float(self.time @ before)
        ratio = min(1.0, ahead / behind) if behind > 0.0 else 1.0
        rounding = (chain.longest + 8) * ROUND * (ahead + behind)
        return ratio, rest * chain.q * (
            float(self.time @ np.abs(y - ratio * before)) + rounding
        ) * (1 + 1e-9)

    def around(
        self, y: Floats, c: float, mass: float, q: float, rest: float
    ) -> tuple[float, float]:
        """Bounds on what remains from a start of this mass, by the distance from a level c."""
        low = c * rest * (mass - self.leak) - q * float(self.time @ np.maximum(c - y, 0.0)) * (
            1 + 1e-9
        )
        return max(0.0, low), c * rest * mass + q * float(self.time @ np.maximum(y - c, 0.0)) * (
            1 + 1e-9
        )


def uniformise(
    rates: SparseMatrix | SweepOperator, exit_rates: Floats, transposed: bool = False
) -> Chain:
    """The chain of a CTMC at its fastest rate; `transposed` for distributions (rows are needed then)."""
    q = float(np.max(exit_rates, initial=0.0)) or 1.0
    diagonal = 1.0 - exit_rates / q
    diagonal[diagonal < 4 * ROUND] = 0.0
    if not isinstance(rates, SparseMatrix):
        return Chain(q, diagonal, None, rates, int(getattr(rates, "longest", 10_000)))
    arrays = (rates.indptr, rates.indices, rates.data)
    if transposed:
        arrays = sparse.transpose_values(*arrays, rates.columns)
    matrix = SparseMatrix(arrays[0], arrays[1], arrays[2] / q, rates.columns)
    return Chain(q, diagonal, matrix, None, int(np.max(np.diff(matrix.indptr), initial=0)))
