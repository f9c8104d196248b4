"""Interval iteration for probabilities, with products only.

Lower bounds start at 0 and upper bounds at 1. If rows are given, end components are collapsed first
(for maximal probabilities). Without rows the bounds are correct, but they need not converge if
there are end components; the method 'optimistic' does.

Source: Haddad & Monmege (2018), Interval iteration algorithm for MDPs and IMDPs.
"""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.numerics import tuning
from symcheck.numerics.linear.bellman import BellmanOperator, max_width
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.methods.method import CHAINS_AND_MDPS, Method
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHOD"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Certified bounds on probabilities."""
    quotient = collapse(problem) if problem.matrix is not None else None
    if quotient is not None:
        return quotient.expand(solve(quotient.problem, settings, observer))
    bellman = BellmanOperator.of(problem)
    lower, upper = np.zeros(problem.n), np.ones(problem.n)
    count, width = 0, 1.0
    for count in range(1, settings.max_iterations + 1):
        before = lower, upper
        lower, upper = bellman.improve_both(lower, upper)
        width = max_width(lower, upper, settings.relative)
        if observer is not None:
            observer(Progress("interval", count, width, problem.n, lower, upper))
        if width <= settings.epsilon:
            break
        if (
            count % tuning.STALL_CHECK_INTERVAL == 0
            and np.array_equal(lower, before[0])
            and np.array_equal(upper, before[1])
        ):
            break  # rounding prevents closer bounds
    note = f"{problem.n} states: interval iteration, {count} iterations"
    note += "" if width <= settings.epsilon else ", accuracy not reached"
    policy = bellman.greedy_policy(lower if problem.direction == Direction.MAX else upper)
    return Solution(lower, upper, "interval", False, True, count, note, {"width": width}, policy)


METHOD = Method(
    "interval",
    solve,
    "products",
    True,
    "lower and upper bounds from both sides",
    kinds=CHAINS_AND_MDPS - {"reward"},
)
