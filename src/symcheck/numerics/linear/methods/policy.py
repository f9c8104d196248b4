"""Policy iteration on the whole system (Howard 1960), each policy's chain solved component by component.

Right where values converge slowly, and the only certified method for negative rewards with choices.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from symcheck.errors import NumericalError
from symcheck.numerics.linear.mec_quotient import collapse, unit
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.linear.subsystem import LocalSystem, policy_iteration
from symcheck.numerics.settings import Settings

__all__ = ["Solver", "solve"]


class Solver(Protocol):
    """A method that solves problems without choices."""

    def __call__(
        self, problem: LinearProblem, settings: Settings, observer: Observer | None = None, /
    ) -> Solution:
        """Bounds of the solution."""
        ...


def solve(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None, *, chains: Solver
) -> Solution:
    """Certified bounds; `chains` solves problems without choices. Raises NumericalError where no proof is found.

    There is none where some strategy may never leave, and collect rewards for ever.
    """
    if problem.mode == 0:
        return chains(problem, settings, observer)
    smaller = collapse(problem)
    if smaller is not None:
        return smaller.expand(solve(smaller.problem, settings, observer, chains=chains))
    local = LocalSystem.whole(problem)
    found = policy_iteration(local, settings.epsilon, chains)
    if found is None:
        raise NumericalError(
            "policy iteration found no certificate: some strategy may collect rewards for ever"
        )
    assert found.policy is not None
    lower, upper = (
        (unit(found.lower), unit(found.upper))
        if problem.probability
        else (found.lower, found.upper)
    )
    note = f"{problem.n} states: policy iteration, {found.iterations} policies"
    width = float(np.max(upper - lower, initial=0.0))
    return Solution(
        lower,
        upper,
        "policy",
        False,
        True,
        found.iterations,
        note,
        {"width": width},
        local.block.chosen(found.policy),
    )
