"""What the methods share that only multiply: one step of the iteration, on whole vectors, with its rounding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s
from symcheck.numerics.linear.problem import LinearProblem

__all__ = ["Stepper"]

THREADED = 100_000
"""States from which a second thread is worth its while."""


@dataclass(frozen=True, eq=False)
class Stepper:
    """x → opt(A x + b). `slip` bounds the relative rounding of a step with non-negative terms."""

    problem: LinearProblem
    slip: float
    starts: Int64s | None

    @staticmethod
    def of(problem: LinearProblem) -> Stepper:
        """The step of a problem; an operator that does not tell its longest row (`longest`) is taken to have 10 000 entries."""
        if problem.matrix is not None:
            longest = int(np.max(np.diff(problem.matrix.indptr), initial=0))
        else:
            longest = int(getattr(problem.operator, "longest", 10_000))
        choices = problem.choices
        return Stepper(problem, (longest + 8) * 2.0**-53, None if choices is None else choices[:-1])

    def product(self, x: Floats) -> Floats:
        """A x, per row."""
        matrix = self.problem.matrix
        if self.problem.operator is not None:
            return self.problem.operator.multiply(x)
        assert matrix is not None
        out = np.empty(matrix.rows)
        sparse.multiply(matrix.indptr, matrix.indices, matrix.data, x, out)
        return out

    def best(self, rows: Floats) -> Floats:
        """The best row of each state."""
        if self.starts is None:
            return rows
        pick = np.maximum if self.problem.direction == Direction.MAX else np.minimum
        return pick.reduceat(rows, self.starts)

    def step(self, x: Floats) -> Floats:
        """One step, rounded to nearest."""
        return self.best(self.product(x) + self.problem.constant)

    def below(self, x: Floats) -> Floats:
        """One step on lower bounds, rounded down."""
        return self.step(x) * (1.0 - self.slip)

    def above(self, x: Floats) -> Floats:
        """One step on upper bounds, rounded up."""
        out = self.best(self.product(x) + self.problem.high) * (1.0 + self.slip)
        return np.where(out > 0.0, out + 1e-307, 0.0)

    def raised(self, lower: Floats) -> Floats:
        """Better lower bounds: a step, or a sweep where the operator offers one (`sweep`, which uses new values at once)."""
        sweep = getattr(self.problem.operator, "sweep", None)
        if sweep is None:
            return np.maximum(lower, self.below(lower))
        out = lower.copy()
        sweep(out, self.problem.constant, self.problem.direction, self.slip, upper=False)
        return out

    def lowered(self, upper: Floats) -> Floats:
        """Better upper bounds, likewise. `upper` must be known to be bounds: the result proves nothing about it."""
        sweep = getattr(self.problem.operator, "sweep", None)
        if sweep is None:
            return np.minimum(upper, self.above(upper))
        out = upper.copy()
        sweep(out, self.problem.high, self.problem.direction, self.slip, upper=True)
        return out

    def tightened(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        """Both; large sweeps side by side on two threads (each does the same as alone)."""
        if len(lower) < THREADED or not hasattr(self.problem.operator, "sweep"):
            return self.raised(lower), self.lowered(upper)
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(1) as pool:
            other = pool.submit(self.raised, lower)
            return (self.lowered(upper), other.result())[::-1]

    def strategy(self, x: Floats) -> Int64s | None:
        """The first best row of each state, at x."""
        if self.starts is None:
            return None
        rows = self.product(x) + self.problem.constant
        counts = np.diff(np.append(self.starts, len(rows)))
        hits = np.flatnonzero(rows == np.repeat(self.best(rows), counts))
        owner = np.searchsorted(self.starts, hits, side="right") - 1
        _, first = np.unique(owner, return_index=True)
        return hits[first].astype(np.int64)


def widest(lower: Floats, upper: Floats, relative: bool) -> float:
    """The greatest width, relative to the upper bound if so wished."""
    if not np.isfinite(upper).all():
        return np.inf
    width = upper - lower
    if relative:
        width = width / np.maximum(upper, 1e-300)
    return float(np.max(width, initial=0.0))
