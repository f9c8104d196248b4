"""Long-run averages of Markov decision processes in rational arithmetic."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.rational.engine import ExactEngine
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.long_run.mean_payoff import component_gains, ending

__all__ = ["mean_payoff"]


def mean_payoff(
    context: Context, engine: ExactEngine, rewards: Numbers, direction: Direction | None
) -> Numbers:
    """The least or greatest long-run average of a reward per row (Fractions), at each state.

    Raises NumericalError where policy iteration does not end.
    """
    assert direction is not None
    if context.options.fairness:
        raise UnsupportedError(
            "long-run averages over fair strategies only are not supported; without -fair they are"
        )
    matrix = replace(engine.matrix, data=engine.rationals.values)
    part = ending(matrix, component_gains(matrix, rewards, direction, context.options), direction)
    found = solve_linear(part.problem, context.options)
    context.log.runs.append(
        SolverRun("exact", "rational policy iteration", engine.states, found.iterations)
    )
    return found.lower[part.place]
