"""The Gauss-Seidel method: an estimate by sweeps that use new values at once."""

from __future__ import annotations

import numpy as np

from symcheck.kernels.solve.certificates import gauss_seidel_sweep
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.bellman import iterate_to_estimate
from symcheck.numerics.linear.methods.method import Method
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHOD"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Sweep over the states from 0, forwards and backwards in turns."""
    m = problem.rows
    x = np.zeros(problem.n)
    backwards = True

    def step(_: Floats) -> Floats:
        nonlocal backwards
        backwards = not backwards
        gauss_seidel_sweep(*m.arrays, m.groups, problem.constant, x, problem.mode, backwards)
        return x.copy()

    return iterate_to_estimate("gauss-seidel", step, problem, settings, observer)


METHOD = Method(
    "gauss-seidel", solve, "rows", False, "sweeps until the change is small: an estimate"
)
