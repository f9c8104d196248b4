"""The probability of the complement of `left U right`, computed without subtraction from 1.

Where the probability of the complement is small, a difference would have few correct digits or
none. The complement means reaching a state from which the until formula can no longer be satisfied,
or staying in `left` and outside `right` until the end of the window.
"""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.check.measure_selection import timed_measures
from symcheck.check.measures.reachability import until
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.time_bounds import Window

__all__ = ["complement_until"]


def complement_until(
    context: Context, path: UntilPath[StateSet], direction: Direction | None, certain: StateSet
) -> Values:
    """Probability that a run does not satisfy `left U right` within the window of `path`.

    For engines in floating point.

    Args:
        context: the engine, the options and the log.
        path: the negated until formula.
        direction: minimise or maximise the probability of the complement; None for a chain.
        certain: the states where that probability is 1 without a window.

    Returns:
        Values in [0, 1], certified within `options.epsilon`.
    """
    left, right = path.left, path.right
    if path.window.is_unbounded:
        return (
            _least(context, left, right)
            if direction is Direction.MIN
            else until(context, left - right, certain, direction)
        )

    def unbounded(inner: Context) -> Values:
        return complement_until(inner, replace(path, window=Window()), direction, certain)

    return timed_measures(context).bounded_until(context, path, direction, unbounded)


def _least(context: Context, left: StateSet, right: StateSet) -> Values:
    """The least probability of the complement without a window, in an MDP.

    A strategy that maximises the probability of the until formula leaves every end component
    outside `right`. So the least probability of reaching the states where the formula is impossible
    is computed on the quotient by end components, each of which must be left.
    """
    graph = context.engine.graph
    impossible, certain = (
        graph.prob0(left, right, Direction.MAX),
        graph.prob1(left, right, Direction.MAX),
    )
    system = context.engine.system(~(impossible | certain), Direction.MIN)
    constant = system.one_step_probability(impossible)
    equations = system.equations(constant, probability=True, allow_stay=True)
    return context.solve(equations, known=[(impossible, 1.0)])
