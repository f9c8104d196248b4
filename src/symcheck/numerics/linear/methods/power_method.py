"""The power method (value iteration from below): an estimate by repeated products."""

from __future__ import annotations

from symcheck.numerics.linear.bellman import BellmanOperator, iterate_to_estimate
from symcheck.numerics.linear.methods.method import Method
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHOD"]


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Iterate x ← opt(A x + b) from 0."""
    apply = BellmanOperator.of(problem).apply
    return iterate_to_estimate("power", apply, problem, settings, observer)


METHOD = Method(
    "power", solve, "products", False, "products until the change is small: an estimate"
)
