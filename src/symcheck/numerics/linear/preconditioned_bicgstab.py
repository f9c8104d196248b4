"""BiCGStab on an M-matrix I - A between its own triangles (van der Vorst 1992): candidates for what is certified elsewhere.

With K1 the lower and K2 the upper triangle of I - A, the method works on K1^-1 (I - A) K2^-1, which preconditions as a
Gauss-Seidel sweep to and fro does, and takes no more than one pass over A to multiply with (Eisenstat 1981).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.matrices.rows import Floats, Int32s, SparseMatrix

__all__ = ["Split", "relative_solution", "scaled"]

ANGLE = 0.7  # cosine, between what is left and what is taken from it
LOST = 1e-11  # of the greatest residual so far: what is smaller may be its rounding
SOON, STEPS = (
    100,
    400,
)  # of BiCGStab, for a solution relative to a guess: until a tenth is left, and in all
FEW, MANY = 256, 65_536  # distinct values that are stored as codes of a byte, and of two

_Values = NDArray[np.generic]  # codes, or numbers
_Triangle = tuple[Int32s, Int32s, _Values]  # entries per row, indices, values


@dataclass(eq=False)
class Split:
    """I - diag(scale) R, without R's loops; `steps` counts those made. Memory: 5 bytes per entry where few values differ, else 12."""

    scale: Floats
    table: Floats
    low: _Triangle
    up: _Triangle
    shift: tuple[Floats, Floats] | None = None
    steps: int = 0

    @staticmethod
    def of(matrix: SparseMatrix, scale: Floats) -> Split:
        """For a square matrix R of one row per state, non-negative, and scale float64[n]."""
        low, up = (np.empty(matrix.states, np.int32) for _ in range(2))
        lower, upper = ssor_eisenstat.sizes(matrix.indptr, matrix.indices, low, up)
        table = ssor_eisenstat.distinct(matrix.data, MANY)
        kind = np.float64 if table is None else np.uint8 if len(table) <= FEW else np.uint16
        below, above = np.empty(lower, kind), np.empty(upper, kind)
        left, right = np.empty(lower, np.int32), np.empty(upper, np.int32)
        table = np.ones(1) if table is None or not len(table) else table
        ssor_eisenstat.fill(
            matrix.indptr, matrix.indices, matrix.data, table, left, below, right, above
        )
        return Split(scale, table, (low, left, below), (up, right, above))

    def shifted(self, column: Floats, row: Floats) -> Split:
        """The same with column · row^T added to I - A."""
        return Split(self.scale, self.table, self.low, self.up, (self.below(column), row))

    def below(self, v: Floats) -> Floats:
        """K1^-1 v."""
        w = np.empty_like(v)
        ssor_eisenstat.forth(
            *self.low, self.table, self.scale, v, np.zeros_like(v), w, np.empty_like(v), v
        )
        return w

    def above(self, v: Floats) -> Floats:
        """K2^-1 v."""
        t = np.empty_like(v)
        self._back(v, np.zeros_like(v), v, 0.0, 0.0, t)  # nothing times what is no number is none
        return t

    def solve(self, right: Floats) -> Iterator[tuple[Floats, float]]:
        """Yield, step by step, K2 x (see `above`), and the greatest entry of K1^-1 (right - (I - A) x).

        Stops where the method breaks down. Residuals that have grown lose digits: when they have come down again the method
        starts anew from the true one. The array is the method's own: look, do not write. Memory: 9 vectors.
        """
        first = self.below(right)
        x, r = np.zeros_like(right), first.copy()
        p, v, t, q, w = (np.zeros_like(right) for _ in range(5))
        while True:
            shadow = r.copy()
            rho = square = greatest = float(np.einsum("i,i->", r, r))
            beta = gamma = 0.0
            if not 0.0 < square < math.inf:
                return
            while square > LOST * LOST * greatest:
                self.steps += 1
                self._back(r, p, v, beta, gamma, t)
                along, _ = self._product(p, t, w, v, shadow)
                if not (abs(rho) > 0.0 and abs(along) > 0.0 and math.isfinite(along)):
                    return
                alpha = rho / along
                self._back(r, r, v, 0.0, alpha, t)
                inner, outer = self._product(r, t, w, q, r)
                omega = _steady(inner, outer, float(np.einsum("i,i->", r, r)))
                before = rho
                rho, square, most = ssor_eisenstat.update(x, p, r, q, shadow, alpha, omega)
                if not math.isfinite(omega * square):
                    return
                yield x, most
                greatest = max(greatest, square)
                if omega == 0.0:
                    return
                beta = rho * alpha / (before * omega)
                gamma = beta * omega
            self._back(x, p, x, 0.0, 0.0, t)
            self._product(x, t, w, q, x)
            np.subtract(first, q, out=r)

    def _back(self, r: Floats, p: Floats, v: Floats, beta: float, gamma: float, t: Floats) -> None:
        ssor_eisenstat.back(*self.up, self.table, self.scale, r, p, v, beta, gamma, t)

    def _product(
        self, v: Floats, t: Floats, w: Floats, out: Floats, other: Floats
    ) -> tuple[float, float]:
        """K1^-1 (I - A) t into `out`, where v = K2 t; returns (other·out, out·out). w is scratch."""
        found = ssor_eisenstat.forth(*self.low, self.table, self.scale, v, t, w, out, other)
        if self.shift is None:
            return found
        column, row = self.shift
        return ssor_eisenstat.shift(out, column, float(np.einsum("i,i->", row, t)), other)


def _steady(inner: float, outer: float, square: float) -> float:
    """The step along t that leaves least of s, or longer where they are far from parallel: steps near 0 lose all that was found.

    Given s·t, t·t and s·s (Sleijpen & van der Vorst 1995).
    """
    if not (outer > 0.0 and square > 0.0):
        return 0.0
    omega, angle = inner / outer, abs(inner) / math.sqrt(outer) / math.sqrt(square)
    return omega if angle >= ANGLE or angle == 0.0 else omega * ANGLE / angle


def scaled(rates: SparseMatrix, weights: Floats) -> SparseMatrix:
    """diag(w)^-1 rates diag(w)."""
    data = weights[rates.indices]
    data *= rates.data
    data *= np.repeat(1.0 / weights, np.diff(rates.indptr))
    return SparseMatrix(rates.indptr, rates.indices, data, rates.columns)


def relative_solution(
    matrix: SparseMatrix, scale: Floats, right: Floats, guess: Floats, goal: float
) -> Floats | None:
    """(I - diag(scale) R)^-1 diag(scale) right for R without its loops, positive; None where that is not found soon.

    guess: positive, about as large as the solution is, to within some orders of magnitude; residuals come down to goal · guess.
    """
    split, first = Split.of(scaled(matrix, guess), scale), 0.0
    for x, rest in split.solve(right * scale / guess):
        first = rest if split.steps == 1 else first
        if rest <= goal:
            found = split.above(x) * guess
            return found if bool(np.all(found > 0.0)) else None
        if split.steps > STEPS or (split.steps == SOON and rest > 0.1 * first):
            break
    return None
