"""BiCGStab for M-matrices I - A, preconditioned by their own triangles.

With K1 the lower and K2 the upper triangle of I - A, the method solves with K1^-1 (I - A) K2^-1.
This preconditions as a symmetric Gauss-Seidel sweep does (SSOR), and one multiplication is one pass
over the entries of A. The solutions are candidates: callers prove bounds around them. Threads share
the work on large matrices, and change no digit.

Sources: van der Vorst (1992) for BiCGStab; Eisenstat (1981) for the multiplication.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.chains.row_blocks import RowBlocks
from symcheck.matrices.rows import Floats, Int32s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.parallel.threads import on_team

__all__ = ["SplitMatrix", "relative_solution", "scaled"]

_Triangle = tuple[RowBlocks, Int32s, Int32s, Floats]  # blocks, entries per row, indices, values


@dataclass(eq=False)
class SplitMatrix:
    """D^-1 (I - diag(scale) R) D, D = diag(unit), without the diagonal of R, as two triangles.

    scale: float64[n]. unit: float64[n], empty for ones. shift: a matrix of rank one to add (see
    `with_rank_one`). steps: BiCGStab steps made. scratch: the vectors of `solve`.
    Memory: 12 bytes per entry.
    """

    scale: Floats
    low: _Triangle
    up: _Triangle
    unit: Floats = field(default_factory=lambda: np.empty(0))
    shift: tuple[Floats, Floats] | None = None
    steps: int = 0
    scratch: list[Floats] = field(default_factory=list)

    @staticmethod
    def of(matrix: SparseMatrix, scale: Floats) -> SplitMatrix:
        """For a non-negative square matrix R with one row per state, and scale float64[n]."""
        low, up = (np.empty(matrix.states, np.int32) for _ in range(2))
        lower, upper = ssor_eisenstat.triangle_sizes(matrix.indptr, matrix.indices, low, up)
        below, above = np.empty(lower), np.empty(upper)
        left, right = np.empty(lower, np.int32), np.empty(upper, np.int32)
        ssor_eisenstat.fill_triangles(*matrix.arrays, left, below, right, above)
        most = tuning.ROW_BLOCKS if matrix.entries >= tuning.THREADED_TRIANGLES else 1
        first, second = (
            RowBlocks(count, indices, upper, most, tuning.MIN_BLOCK_ROWS)
            for count, indices, upper in ((low, left, False), (up, right, True))
        )
        return SplitMatrix(scale, (first, low, left, below), (second, up, right, above))

    def relative_to(self, unit: Floats) -> SplitMatrix:
        """The same matrix for solutions that are divided by positive numbers, float64[n]."""
        return replace(self, unit=unit, steps=0)

    def with_rank_one(self, column: Floats, row: Floats) -> SplitMatrix:
        """The same with column · row^T added to I - A; without units."""
        return replace(self, shift=(self.solve_lower(column), row), steps=0)

    def solve_lower(self, v: Floats) -> Floats:
        """K1^-1 v."""
        w, out = np.empty_like(v), np.empty_like(v)
        self._solve_lower(v, np.zeros_like(v), w, out, v)
        return out

    def solve_upper(self, v: Floats) -> Floats:
        """D K2^-1 v."""
        t = np.empty_like(v)
        self._combine_and_solve_upper(v, v, v, 0.0, 0.0, t)  # which leaves v as it is
        return t

    def solve(self, right: Floats) -> Iterator[tuple[Floats, float]]:
        """Iterate towards the solution of (I - A) x = right.

        Residuals that have grown lose digits, so the method restarts from the true residual once
        they have fallen again. Memory: 9 vectors, which the next solution uses again.

        Yields:
            K2 D^-1 x after each step (`solve_upper` gives x), and the largest absolute entry of
            K1^-1 D^-1 (right - (I - A) x). The array belongs to the method and must not be written
            to. The iteration ends if the method breaks down.
        """
        if not self.scratch:  # kept, because new memory takes as long as a step
            self.scratch += [np.empty_like(right) for _ in range(9)]
        first, x, r, p, v, t, q, w, shadow = self.scratch
        for vector in (x, p, v, t):
            vector.fill(0.0)
        self._solve_lower(right / self.unit if len(self.unit) else right, t, w, first, right)
        np.copyto(r, first)
        while True:
            np.copyto(shadow, r)
            rho = square = greatest = float(np.einsum("i,i->", r, r))
            beta = gamma = 0.0
            if not 0.0 < square < math.inf:
                return
            while square > tuning.RESTART_REDUCTION**2 * greatest:
                self.steps += 1
                self._combine_and_solve_upper(r, p, v, beta, gamma, t)
                along, _ = self._product(p, t, w, v, shadow)
                if not (abs(rho) > 0.0 and abs(along) > 0.0 and math.isfinite(along)):
                    return
                alpha = rho / along
                own = self._combine_and_solve_upper(r, r, v, 0.0, alpha, t)
                inner, outer = self._product(r, t, w, q, r)
                omega = _stabilising_step(inner, outer, own)
                before = rho
                rho, square, most = self._update(x, p, r, q, shadow, alpha, omega)
                if not math.isfinite(omega * square):
                    return
                yield x, most
                greatest = max(greatest, square)
                if omega == 0.0:
                    return
                beta = rho * alpha / (before * omega)
                gamma = beta * omega
            self._combine_and_solve_upper(x, p, x, 0.0, 0.0, t)
            self._product(x, t, w, q, x)
            np.subtract(first, q, out=r)

    def solution(self, right: Floats, goal: float, patience: int) -> Floats | None:
        """The solution of (I - A) x = right, or None if the method does not converge.

        Args:
            right: float64[n].
            goal: the residual to reach, as `solve` measures it.
            patience: the steps within which the residual must fall by a factor of ten.
        """
        least, last = math.inf, self.steps
        for x, residual in self.solve(right):
            if residual <= goal:
                return self.solve_upper(x)
            if residual < 0.1 * least:
                least, last = residual, self.steps
            if not math.isfinite(residual) or self.steps - last > patience:
                break
        return None

    def _combine_and_solve_upper(
        self, r: Floats, p: Floats, v: Floats, beta: float, gamma: float, t: Floats
    ) -> float:
        """P = r + beta p - gamma v, and t = D K2^-1 p; returns p · p."""
        matrix, vectors = (*self.up, self.scale, self.unit), (r, p, v, beta, gamma, t)
        return _sums(self.up[0], partial(ssor_eisenstat.solve_upper, *matrix, *vectors))[0]

    def _solve_lower(
        self, v: Floats, t: Floats, w: Floats, out: Floats, other: Floats
    ) -> tuple[float, float]:
        matrix, vectors = (*self.low, self.scale, self.unit), (v, t, w, out, other)
        return _sums(self.low[0], partial(ssor_eisenstat.solve_lower, *matrix, *vectors))

    def _product(
        self, v: Floats, t: Floats, w: Floats, out: Floats, other: Floats
    ) -> tuple[float, float]:
        """Write K1^-1 D^-1 (I - A) t into `out`, where v = K2 D^-1 t; w is scratch.

        Returns:
            The inner products other·out and out·out.
        """
        products = self._solve_lower(v, t, w, out, other)
        if self.shift is None:
            return products
        column, row = self.shift
        return ssor_eisenstat.add_multiple(out, column, float(np.einsum("i,i->", row, t)), other)

    def _update(
        self,
        x: Floats,
        p: Floats,
        r: Floats,
        q: Floats,
        shadow: Floats,
        alpha: float,
        omega: float,
    ) -> tuple[float, float, float]:
        """X += alpha p + omega r, then r -= omega q; shadow · r, r · r and the greatest |r|."""
        n, count = len(x), tuning.VECTOR_PARTS if self.low[0].blocks > 1 else 1
        parts = [(n * i // count, n * (i + 1) // count) for i in range(count)]
        found: dict[int, tuple[float, float, float]] = {}
        claimed = iter(parts)

        def work() -> None:
            for first, end in claimed:
                found[first] = ssor_eisenstat.update_iterate(
                    x, p, r, q, shadow, alpha, omega, first, end
                )

        on_team(work, count)
        dots, squares, largest = zip(*(found[first] for first, _ in parts), strict=True)
        return sum(dots), sum(squares), max(largest)


def _sums(blocks: RowBlocks, work: Callable[[], None]) -> tuple[float, float]:
    """The sums of the blocks of a triangle that threads work on."""
    blocks.begin()
    on_team(work, blocks.blocks // blocks.levels)
    return blocks.totals()


def _stabilising_step(inner: float, outer: float, square: float) -> float:
    """The step along t that minimises the residual s, but not too short: short steps lose accuracy.

    Args:
        inner: s·t.
        outer: t·t.
        square: s·s.

    Source: Sleijpen & van der Vorst (1995).
    """
    if not (outer > 0.0 and square > 0.0):
        return 0.0
    omega, angle = inner / outer, abs(inner) / math.sqrt(outer) / math.sqrt(square)
    return (
        omega if angle >= tuning.MIN_COSINE or angle == 0.0 else omega * tuning.MIN_COSINE / angle
    )


def scaled(rates: SparseMatrix, weights: Floats) -> SparseMatrix:
    """diag(weights)^-1 rates diag(weights)."""
    data = weights[rates.indices]
    data *= rates.data
    data *= np.repeat(1.0 / weights, rates.lengths)
    return SparseMatrix(rates.indptr, rates.indices, data, rates.columns)


def relative_solution(
    matrix: SparseMatrix,
    scale: Floats,
    right: Floats,
    guess: Floats,
    goal: float,
    *,
    early: int = tuning.EARLY_BICGSTAB_STEPS,
    largest: float = math.inf,
) -> Floats | None:
    """A positive approximation of (I - diag(scale) R)^-1 diag(scale) right, or None.

    Args:
        matrix: R, whose diagonal is ignored.
        scale: float64[n].
        right: float64[n], non-negative.
        guess: the solution to within some orders of magnitude, positive.
        goal: the residual to reach, relative to the guess.
        early: the steps after which at most a tenth of the residual may remain.
        largest: the residual, relative to the guess, above which the method gives up.
    """
    # The greatest value is about 2^721, so that the smallest ones are no subnormal numbers.
    boost = 2.0 ** min(1000, 721 - math.frexp(float(guess.max()))[1])
    split, first = SplitMatrix.of(matrix, scale).relative_to(guess * boost), 0.0
    for x, rest in split.solve(right * scale * boost):
        first = rest if split.steps == 1 else first
        if rest <= goal:
            solution = split.solve_upper(x) / boost
            return solution if bool(np.all(solution > 0.0)) else None
        if (
            split.steps > tuning.BICGSTAB_STEPS
            or rest > largest
            or (split.steps == early and rest > 0.1 * first)
        ):
            break
    return None
