"""Policy iteration on the whole system; the chain of each policy is solved component by component.

It suits values that converge slowly, and it is the only certified method for negative rewards with
choices. Source: Howard (1960), Dynamic programming and Markov processes.
"""

from __future__ import annotations

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Floats, Int32s
from symcheck.numerics.linear.methods.method import Solver
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress, Solution
from symcheck.numerics.linear.subsystem import LocalSystem, policy_iteration
from symcheck.numerics.settings import Settings
from symcheck.tables import counted

__all__ = ["solve"]


def solve(
    problem: LinearProblem, settings: Settings, observer: Observer | None = None, *, chains: Solver
) -> Solution:
    """Certified bounds.

    Args:
        problem: any problem with rows.
        settings: accuracy and limits.
        observer: receives the progress.
        chains: solves problems without choices.

    Raises:
        NumericalError: no proof was found. There is none if some policy may never leave the
            unknown states and collects rewards forever.
    """
    if problem.mode == 0:
        return chains(problem, settings, observer)
    local = LocalSystem.whole(problem)

    def report(count: int, values: Floats, policy: Int32s) -> None:
        if observer is not None:
            rows = local.block.global_rows(policy)
            observer(Progress("policy", count, np.inf, problem.n, values, policy=rows))

    result = policy_iteration(local, settings.epsilon, chains, observer=report)
    if result is None:
        raise NumericalError(
            "policy iteration found no certificate: some strategy may collect rewards forever"
        )
    assert result.policy is not None
    lower, upper = result.lower, result.upper
    if problem.probability:
        lower, upper = np.clip(lower, 0.0, 1.0), np.clip(upper, 0.0, 1.0)
    note = f"{counted(problem.n, 'state')}: policy iteration, {result.iterations} policies"
    rows = local.block.global_rows(result.policy)
    return Solution(lower, upper, "policy", False, True, result.iterations, note, rows)
