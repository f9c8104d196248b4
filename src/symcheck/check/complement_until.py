"""The probability of the complement of `left U right`, computed directly instead of as a difference.

1 minus the probability of left U right is the same number; but where that is small, the subtraction leaves it few digits,
or none. The complement of left U right: reaching a state from which the until formula can no longer be satisfied, or staying
between until the end of the window.
"""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measure_selection import timed_measures
from symcheck.check.measures.reachability import until
from symcheck.check.path_formulas import UntilPath
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values

__all__ = ["complement_until"]


def complement_until(
    context: Context, path: UntilPath, direction: Direction | None, certain: StateSet
) -> Values:
    """(Least or greatest) probability that a run does not satisfy left U right within the window of `path`.

    certain: where it is 1 without a window. For engines in floating point; accuracy as `options.epsilon` says.
    """
    left, right = path.left, path.right
    if path.window.trivial:
        return (
            _least(context, left, right)
            if direction is Direction.MIN
            else until(context, left - right, certain, direction)
        )

    def unbounded(inner: Context) -> Values:
        return complement_until(inner, UntilPath(left, right), direction, certain)

    return timed_measures(context).bounded_complement(
        context, left, right, path.window, direction, unbounded
    )


def _least(context: Context, left: StateSet, right: StateSet) -> Values:
    """The least probability in an MDP: that of the strategies which reach `right` most often.

    Such a strategy stays in no end component between: it leaves at last, to where it may still succeed, or fail for certain.
    So with end components made into single states that must be left, the least probability of the latter is the answer.
    """
    graph = context.engine.graph
    never, surely = graph.prob0(left, right, Direction.MAX), graph.prob1(left, right, Direction.MAX)
    system = context.engine.system(~(never | surely), Direction.MIN)
    constant = system.embedded(system.one_step_probability(never))
    equations = system.equations(constant, probability=True, allow_stay=True)
    return context.solve(equations, known=[(never, 1.0)])
