"""Bounds on unbounded until probabilities of a matrix: graph analysis, then linear equations."""

from __future__ import annotations

from symcheck.direction import Direction
from symcheck.matrices.numbers import Numbers, numbers
from symcheck.matrices.rows import Bools, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.tuning import ENTRY_ERROR

__all__ = ["until_bounds"]


def until_bounds(
    matrix: SparseMatrix,
    left: Bools,
    right: Bools,
    direction: Direction | None,
    settings: Settings,
    *,
    closed: bool = True,
    observer: Observer | None = None,
    error: float = ENTRY_ERROR,
) -> tuple[Numbers, Numbers]:
    """Proved bounds on the probability of `left U right` from each state, rounding included.

    Args:
        matrix: one-step probabilities among n states; its groups are the choices.
        left: the states in which a path may go on, bool[n].
        right: the states in which it ends, bool[n].
        direction: minimise or maximise; None without choices.
        settings: accuracy and method.
        closed: whether each row sums to 1; if not, what is missing leaves and fails.
        observer: receives the progress.
        error: of the probabilities, relative.

    Returns:
        Lower and upper bounds, float64[n], or the same rationals twice.
    """
    from symcheck.numerics.linear.methods import solve_linear

    source = graph.Incidence(matrix)
    # The analysis of probability 1 assumes rows that sum to 1.
    yes = graph.prob1(source, left, right, direction) if closed else right
    no = graph.prob0(source, left, right, direction)
    exact = matrix.is_rational
    low = numbers(yes, rational=exact)
    high = low.copy()
    unknown = ~(yes | no)
    if unknown.any():
        enter, leave = (matrix.sums(unknown, target) for target in (yes, ~unknown))
        part = matrix.among(unknown)
        problem = LinearProblem(enter, part, None, leave, direction, True, error=error)
        solution = solve_linear(problem, settings, observer)
        low[unknown], high[unknown] = solution.lower, solution.upper
    return low, high
