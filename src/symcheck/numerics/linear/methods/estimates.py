"""Estimates by repeated sweeps or products: a small change proves nothing about the error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.solve.certificates import gauss_seidel_sweep
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.bellman import BellmanOperator
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Progress,
    Solution,
    largest_width,
)
from symcheck.numerics.settings import Settings
from symcheck.tables import counted

__all__ = ["gauss_seidel", "jacobi", "power"]


def power(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """The power method (value iteration from below): iterate x ← opt(A x + b) from 0."""
    return _iterate("power", BellmanOperator.of(problem).apply, problem, settings, observer)


def jacobi(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Iterate as the power method does, with each row solved for its own state."""
    matrix = problem.rows
    bellman = BellmanOperator.of(problem)
    owner, row_of_entry = matrix.state_of_row, matrix.row_of_entry
    diagonal = matrix.indices == owner[row_of_entry]
    loops = np.zeros(matrix.rows)
    loops[row_of_entry[diagonal]] = matrix.data[diagonal]
    divisor = np.where(loops < 1.0, 1.0 - loops, np.inf)

    def step(x: Floats) -> Floats:
        rows = (bellman.product(x) - loops * x[owner] + problem.constant) / divisor
        # A row that is only a loop keeps the value, which is never better than reaching the target.
        unused = x[owner] if problem.direction == Direction.MAX else np.inf
        return bellman.best(np.where(np.isinf(divisor), unused, rows))

    return _iterate("jacobi", step, problem, settings, observer)


def gauss_seidel(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Sweep over the states from 0, forwards and backwards in turns, with new values at once."""
    m = problem.rows
    backwards = True

    def step(x: Floats) -> Floats:
        nonlocal backwards
        backwards, swept = not backwards, x.copy()
        gauss_seidel_sweep(*m.arrays, m.groups, problem.constant, swept, problem.mode, backwards)
        return swept

    return _iterate("gauss-seidel", step, problem, settings, observer)


def _iterate(
    name: str,
    step: Callable[[Floats], Floats],
    problem: LinearProblem,
    settings: Settings,
    observer: Observer | None,
) -> Solution:
    """Iterate x ← step(x) from 0 until the change is at most epsilon."""
    x = np.zeros(problem.n)
    count, change = 0, np.inf
    while count < settings.max_iterations and change > settings.epsilon:
        previous, x = x, step(x)
        change = largest_width(np.minimum(previous, x), np.maximum(previous, x), settings.relative)
        count += 1
        if observer is not None:
            observer(Progress(name, count, change, problem.n, x))
    note = f"{counted(problem.n, 'state')}: {name}, {counted(count, 'iteration')}; an estimate"
    note += "" if change <= settings.epsilon else ", not converged"
    policy = BellmanOperator.of(problem).greedy_policy(x)
    return Solution(x, x.copy(), name, False, False, count, note, policy)
