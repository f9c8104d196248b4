"""Interval iteration for probabilities, with products only.

Lower bounds start at 0 and upper bounds at 1. If there are end components (without rows, they are
not collapsed), the bounds are correct but need not converge; those of 'optimistic' do.

Source: Haddad & Monmege (2018), Interval iteration algorithm for MDPs and IMDPs.
"""

from __future__ import annotations

import numpy as np

from symcheck.numerics.linear.bellman import BellmanOperator, iterate_bounds
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["solve"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Certified bounds on probabilities."""
    bellman = BellmanOperator.of(problem)
    lower, upper = np.zeros(problem.n), np.ones(problem.n)
    return iterate_bounds("interval iteration", bellman, lower, upper, 0, settings, observer)
