"""The Jacobi method: an estimate by products, each row solved for its own state."""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.bellman import BellmanOperator, iterate_to_estimate
from symcheck.numerics.linear.methods.method import Method
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHOD"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Iterate as the power method does, with self-loops divided out."""
    matrix = problem.rows
    bellman = BellmanOperator.of(problem)
    owner = np.arange(matrix.rows)
    if matrix.groups is not None:
        owner = np.repeat(np.arange(matrix.states), np.diff(matrix.groups))
    row_of_entry = np.repeat(np.arange(matrix.rows), matrix.lengths)
    diagonal = matrix.indices == owner[row_of_entry]
    loops = np.zeros(matrix.rows)
    loops[row_of_entry[diagonal]] = matrix.data[diagonal]
    divisor = np.where(loops < 1.0, 1.0 - loops, np.inf)

    def step(x: Floats) -> Floats:
        rows = (bellman.product(x) - loops * x[owner] + problem.constant) / divisor
        # A row that is only a loop keeps the value, which is never better than reaching the target.
        unused = x[owner] if problem.direction == Direction.MAX else np.inf
        return bellman.best(np.where(np.isinf(divisor), unused, rows))

    return iterate_to_estimate("jacobi", step, problem, settings, observer)


METHOD = Method(
    "jacobi",
    solve,
    "rows",
    False,
    "products with self-loops divided out until the change is small: an estimate",
)
