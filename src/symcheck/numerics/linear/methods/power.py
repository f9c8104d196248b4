"""The power method, an estimate: a small change proves nothing about the error."""

from __future__ import annotations

import numpy as np

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

__all__ = ["solve"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Value iteration from below: iterate x ← opt(A x + b) from 0 until the change is at most
    epsilon.
    """
    bellman, x = BellmanOperator.of(problem), np.zeros(problem.n)
    count, change = 0, np.inf
    while count < settings.max_iterations and change > settings.epsilon:
        previous, x = x, bellman.apply(x)
        change = largest_width(np.minimum(previous, x), np.maximum(previous, x), settings.relative)
        count += 1
        if observer is not None:
            observer(Progress("power", count, change, problem.n, x))
    note = f"{counted(problem.n, 'state')}: power, {counted(count, 'iteration')}; an estimate"
    note += "" if change <= settings.epsilon else ", not converged"
    return Solution(x, x.copy(), "power", False, False, count, note, bellman.greedy_policy(x))
