"""Iterations that stop when the change is small. What they give is an estimate: no bound on its error is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.solve.certificates import sweep
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.methods.power_method import Stepper, widest
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution, Step
from symcheck.numerics.settings import Settings

__all__ = ["gauss_seidel", "jacobi", "power"]


def power(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Iterate x ← opt(A x + b) from 0."""
    return _iterate("power", Stepper.of(problem).step, problem, settings, observer)


def jacobi(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """As 'power', but each row is solved for its own state: self-loops are divided out."""
    matrix = problem.rows
    stepper = Stepper.of(problem)
    owner = np.arange(matrix.rows)
    if matrix.groups is not None:
        owner = np.repeat(np.arange(matrix.states), np.diff(matrix.groups))
    loops = np.zeros(matrix.rows)
    of_row = np.repeat(np.arange(matrix.rows), np.diff(matrix.indptr))
    own = matrix.indices == owner[of_row]
    loops[of_row[own]] = matrix.data[own]
    rest = np.where(loops < 1.0, 1.0 - loops, np.inf)

    def step(x: Floats) -> Floats:
        rows = (stepper.product(x) - loops * x[owner] + problem.constant) / rest
        # A row that only loops is never left: of no use where something else is to be reached.
        return stepper.best(
            np.where(
                np.isinf(rest), x[owner] if problem.direction == Direction.MAX else np.inf, rows
            )
        )

    return _iterate("jacobi", step, problem, settings, observer)


def gauss_seidel(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """As 'power', with new values used at once, in index order, backwards and forwards in turn."""
    m = problem.rows
    x = np.zeros(problem.n)
    backwards = True

    def step(_: Floats) -> Floats:
        nonlocal backwards
        backwards = not backwards
        sweep(m.indptr, m.indices, m.data, m.groups, problem.constant, x, problem.mode, backwards)
        return x.copy()

    return _iterate("gauss-seidel", step, problem, settings, observer)


def _iterate(
    name: str,
    step: Callable[[Floats], Floats],
    problem: LinearProblem,
    settings: Settings,
    observer: Observer | None,
) -> Solution:
    x = np.zeros(problem.n)
    count, change = 0, np.inf
    while count < settings.max_iterations and change > settings.epsilon:
        after = step(x)
        change = widest(np.minimum(x, after), np.maximum(x, after), settings.relative)
        x = after
        count += 1
        if observer is not None:
            observer(Step(name, count, change, problem.n, x))
    note = f"{problem.n} states: {name}, {count} iterations; an estimate"
    note += "" if change <= settings.epsilon else ", not converged"
    strategy = Stepper.of(problem).strategy(x)
    return Solution(x, x.copy(), name, False, False, count, note, {"change": change}, strategy)
