"""The uniformised chain of a CTMC."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from symcheck.kernels.chains import uniformization
from symcheck.kernels.rows import sparse
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.parallel.threads import on_threads

__all__ = ["UniformizedChain", "uniformize"]


@dataclass(eq=False)
class UniformizedChain:
    """P = I + Q/q, stored as rates divided by q and a diagonal, for multiplication from one side.

    q: the uniformisation rate. longest: the largest number of entries of a row. Either `rates`,
    with its entries divided by q, or `operator`, whose products are divided by q here, is given.
    error: of sums of rates, relative.
    """

    q: float
    diagonal: Floats
    rates: SparseMatrix | None
    operator: SweepOperator | None
    longest: int
    error: float = 0.0

    @property
    def entries(self) -> int:
        """Entries visited per step; 0 if only an operator is given."""
        return 0 if self.rates is None else self.rates.entries + self.rates.rows

    def advance(
        self, y: Floats, z: Floats, total: Floats, weights: Floats, floor: float
    ) -> tuple[Floats, Floats, float, float, float]:
        """Make a step per weight: add weight · y to the total, then replace y by P y.

        Args:
            y: the vector, float64[n]; overwritten.
            z: a buffer, float64[n]; overwritten.
            total: the sum, updated in place.
            weights: one per step.
            floor: entries up to it are ignored by the ratio bounds.

        Returns:
            The new y, the other buffer (the y before), the least and the greatest ratio of entries
            of the new y and the y before, and the largest entry.
        """
        if self.rates is not None:
            m = self.rates
            matrix = (*m.arrays, self.diagonal)
            if len(shares := m.shares()) > 2 and len(weights):
                for weight in weights:
                    parts = (*matrix, y, z, total, weight)
                    on_threads(partial(uniformization.uniformized_rows, *parts), shares)
                    y, z = z, y
                return y, z, *uniformization.step_ratios(z, y, floor)
            even, low, high, most = uniformization.uniformized_steps(
                *matrix, y, z, total, weights, floor
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


def uniformize(
    rates: SparseMatrix | SweepOperator,
    exit_rates: Floats,
    transposed: bool = False,
    error: float = 0.0,
) -> UniformizedChain:
    """The chain of a CTMC, uniformised at its largest exit rate.

    Args:
        rates: the rate matrix, or an operator.
        exit_rates: float64[n].
        transposed: multiply distributions instead of values (rows are needed for it).
        error: of sums of rates, relative.
    """
    q = float(np.max(exit_rates, initial=0.0)) or 1.0
    diagonal = (q - exit_rates) / q  # two roundings: 1 - exit_rates / q would lose digits near 0
    if not isinstance(rates, SparseMatrix):
        return UniformizedChain(q, diagonal, None, rates, rates.longest, error)
    if transposed:
        transpose = sparse.transpose_values(*rates.arrays, rates.columns)
        rates = SparseMatrix(*transpose, rates.columns)
    divided = SparseMatrix(rates.indptr, rates.indices, rates.data / q, rates.columns)
    return UniformizedChain(q, diagonal, divided, None, divided.longest, error)
