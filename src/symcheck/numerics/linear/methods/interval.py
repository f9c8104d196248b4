"""Interval iteration on whole vectors, for engines that only multiply (Haddad & Monmege 2018).

Lower bounds from 0, upper bounds from 1. Given rows, end components are collapsed first (greatest probabilities); without
rows the bounds stay true, but need not meet where there are end components: use 'optimistic' then.
"""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.methods.power_method import Stepper, widest
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution, Step
from symcheck.numerics.settings import Settings

__all__ = ["solve"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Certified bounds on probabilities."""
    smaller = collapse(problem) if problem.matrix is not None else None
    if smaller is not None:
        return smaller.expand(solve(smaller.problem, settings, observer))
    stepper = Stepper.of(problem)
    lower, upper = np.zeros(problem.n), np.ones(problem.n)
    count = 0
    width = 1.0
    for count in range(1, settings.max_iterations + 1):
        before = lower, upper
        lower, upper = stepper.tightened(lower, upper)
        width = widest(lower, upper, settings.relative)
        if observer is not None:
            observer(Step("interval", count, width, problem.n, lower, upper))
        if width <= settings.epsilon:
            break
        if (
            count % 100 == 0
            and np.array_equal(lower, before[0])
            and np.array_equal(upper, before[1])
        ):
            break  # as near as rounding allows
    note = f"{problem.n} states: interval iteration, {count} iterations"
    note += "" if width <= settings.epsilon else ", not as near as wanted"
    at = lower if problem.direction == Direction.MAX else upper
    return Solution(
        lower, upper, "interval", False, True, count, note, {"width": width}, stepper.strategy(at)
    )
