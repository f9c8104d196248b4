"""Proved bounds with products only."""

from __future__ import annotations

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Floats
from symcheck.numerics import tuning
from symcheck.numerics.linear.bellman import BellmanOperator, iterate_bounds
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Progress,
    Solution,
    largest_width,
)
from symcheck.numerics.settings import Settings

__all__ = ["interval", "optimistic"]


def interval(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Interval iteration for probabilities: lower bounds start at 0 and upper bounds at 1.

    If there are end components (without rows, they are not collapsed), the bounds are correct but
    need not converge; those of `optimistic` do.

    Source: Haddad & Monmege (2018), Interval iteration algorithm for MDPs and IMDPs.
    """
    bellman = BellmanOperator.of(problem)
    lower, upper = np.zeros(problem.n), np.ones(problem.n)
    return iterate_bounds("interval iteration", bellman, lower, upper, 0, settings, observer)


def optimistic(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Optimistic value iteration; upper bounds are infinite if no guess could be verified.

    Lower bounds are iterated from 0 until they change little. Then an upper bound is guessed, which
    is proved as soon as one iteration does not raise it. No end components need to be collapsed if
    the least solution is wanted.

    Source: Hartmanns & Kaminski (2020), Optimistic value iteration.
    """
    if problem.signed:
        raise UnsupportedError("method 'optimistic' requires non-negative rewards")
    bellman = BellmanOperator.of(problem)
    lower = np.zeros(problem.n)
    upper: Floats | None = None
    tolerance, rate, last_change, count = settings.epsilon, 0.5, 0.0, 0
    while count < settings.max_iterations and upper is None and tolerance > 1e-17:
        improved = bellman.improve_lower(lower)
        change = largest_width(lower, improved, settings.relative)
        count += 1
        if last_change > 0.0:
            rate = min(0.7 * rate + 0.3 * change / last_change, 1 - 1e-7)
        last_change, difference, lower = change, improved - lower, improved
        if observer is not None:
            observer(Progress("optimistic", count, change, problem.n, lower))
        if change / (1.0 - rate) <= tolerance:
            tolerance *= 0.2
            guess = lower * (1.0 + 0.25 * settings.epsilon) + 2.0 * difference / (1.0 - rate)
            if not settings.relative:
                guess += 0.25 * settings.epsilon
            upper, used = _verify(bellman, lower, guess, tuning.GUESS_ROUNDS + count // 2)
            count += used
    if upper is None:
        upper = np.full(problem.n, 1.0 if problem.probability else np.inf)
    name = "optimistic value iteration"
    return iterate_bounds(name, bellman, lower, upper, count, settings, observer)


def _verify(
    bellman: BellmanOperator, lower: Floats, guess: Floats, rounds: int
) -> tuple[Floats | None, int]:
    """An iterate of the guess that is a proved upper bound, or None; and the number of iterations.

    The proof needs room for rounding, which spreads through the states as slowly as the values did.
    """
    for count in range(1, rounds + 1):
        following = bellman.apply_upwards(guess)
        if np.all(following <= guess):
            return following, count
        if np.any(following < lower):
            return None, count
        guess = following
    return None, rounds
