"""Optimistic value iteration on whole vectors, for engines that only multiply (Hartmanns & Kaminski 2020).

Lower bounds from 0 until they change little; then a guess at upper bounds, which is one as soon as a step does not raise it.
Needs no collapsing of end components where the least solution is wanted.
"""

from __future__ import annotations

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.methods.power_method import Stepper, widest
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution, Step
from symcheck.numerics.settings import Settings

__all__ = ["solve"]

TRIES = 50


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Certified bounds; infinite upper bounds where none could be verified."""
    if problem.signed:
        raise UnsupportedError("method 'optimistic' needs rewards that are not negative")
    smaller = collapse(problem) if problem.matrix is not None else None
    if smaller is not None:
        return smaller.expand(solve(smaller.problem, settings, observer))
    stepper = Stepper.of(problem)
    lower = np.zeros(problem.n)
    upper: Floats | None = None
    tolerance, rate, before, count = settings.epsilon, 0.5, 0.0, 0
    while count < settings.max_iterations and upper is None and tolerance > 1e-17:
        after = stepper.raised(lower)
        change = widest(lower, after, settings.relative)
        count += 1
        rate = min(0.7 * rate + 0.3 * change / before, 1 - 1e-7) if before > 0.0 else rate
        before, difference, lower = change, after - lower, after
        if observer is not None:
            observer(Step("optimistic", count, change, problem.n, lower))
        if change / (1.0 - rate) <= tolerance:
            tolerance *= 0.2
            guess = lower * (1.0 + 0.25 * settings.epsilon) + 2.0 * difference / (1.0 - rate)
            upper, used = _verify(
                stepper,
                lower,
                guess if settings.relative else guess + 0.25 * settings.epsilon,
                TRIES + count // 2,
            )
            count += used
    return _finish(stepper, settings, lower, upper, count)


def _verify(
    stepper: Stepper, lower: Floats, guess: Floats, tries: int
) -> tuple[Floats | None, int]:
    """The guess, or a later iterate of it, if a step does not raise it anywhere; and the number of steps.

    The slack of a guess comes from where something is gained, and takes as many steps to spread as the values did.
    """
    for count in range(1, tries + 1):
        after = stepper.above(guess)
        if np.all(after <= guess):
            return after, count
        if np.any(after < lower):
            return None, count
        guess = after
    return None, tries


def _finish(
    stepper: Stepper, settings: Settings, lower: Floats, upper: Floats | None, count: int
) -> Solution:
    """Narrow verified bounds until they are as near as wanted."""
    problem = stepper.problem
    if upper is None:
        upper = np.ones(problem.n) if problem.probability else np.full(problem.n, np.inf)
    width = widest(lower, upper, settings.relative)
    while np.isfinite(width) and width > settings.epsilon and count < settings.max_iterations:
        before = lower, upper
        lower, upper = stepper.tightened(lower, upper)
        width = widest(lower, upper, settings.relative)
        count += 1
        if (
            count % 100 == 0
            and np.array_equal(lower, before[0])
            and np.array_equal(upper, before[1])
        ):
            break  # as near as rounding allows
    if problem.probability:
        upper = np.minimum(upper, 1.0)
    note = f"{problem.n} states: optimistic value iteration, {count} iterations"
    note += "" if width <= settings.epsilon else ", not as near as wanted"
    at = lower if problem.direction == Direction.MAX else upper
    return Solution(
        lower, upper, "optimistic", False, True, count, note, {"width": width}, stepper.strategy(at)
    )
