"""The computation of until probabilities: prob0, prob1, and the iterates of the linear system."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from symcheck.direction import Direction
from symcheck.numerics.linear.methods import solve_linear

if TYPE_CHECKING:
    from symcheck.engines.base import Engine, StateSet
    from symcheck.numerics.linear.problem import LinearProblem, Progress, Solution
    from symcheck.options import Options

__all__ = ["UntilTrace", "until_trace"]


@dataclass(frozen=True, eq=False)
class UntilTrace:
    """The probability of an until formula in three steps.

    Attributes:
        zero, one: the states with probability 0 and 1, by graph analysis.
        unknown: the other states.
        problem: x = A x + b over the unknown states (None if there are none).
        solution: the solution of the problem.
        steps: the iterations of the numerical method, with copies of the vectors.
    """

    zero: StateSet
    one: StateSet
    unknown: StateSet
    problem: LinearProblem | None = field(repr=False)
    solution: Solution | None = field(repr=False)
    steps: tuple[Progress, ...] = field(repr=False)


def until_trace(
    engine: Engine,
    left: StateSet,
    right: StateSet,
    options: Options,
    direction: Direction | None = None,
) -> UntilTrace:
    """Trace the computation of the probability of `left U right`.

    The trace keeps a copy of each iterate: use it for small models.

    Args:
        engine: the engine.
        left, right: sets of states of the engine.
        options: `options.method` names the method; 'interval' has both bounds.
        direction: minimise or maximise over strategies; None for a chain.

    Raises:
        SymcheckError: as the method.
    """
    zero = engine.graph.prob0(left, right, direction)
    one = engine.graph.prob1(left, right, direction)
    unknown = ~(zero | one)
    if not unknown:
        return UntilTrace(zero, one, unknown, None, None, ())
    problem = engine.system(unknown, direction).reachability(one).problem()
    steps: list[Progress] = []

    def watch(step: Progress) -> None:
        lower, upper = (None if v is None else np.array(v) for v in (step.lower, step.upper))
        steps.append(replace(step, lower=lower, upper=upper))

    solution = solve_linear(problem, options, watch)
    return UntilTrace(zero, one, unknown, problem, solution, tuple(steps))
