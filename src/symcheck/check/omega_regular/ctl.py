"""The path quantifiers A and E over path formulas of any form (CTL*), by graph analysis alone.

One temporal operator over sets of states is a fixpoint on the graph. Any other formula is
translated to a deterministic automaton: a path that satisfies it exists where, in the product, a
path exists that the automaton accepts (Emerson & Lei 1986; Emerson & Halpern 1986).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import count
from operator import and_, or_
from typing import assert_never

from symcheck.check.context import Context
from symcheck.engines.base import Graph, StateSet
from symcheck.errors import UnsupportedError
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
    negated,
)
from symcheck.semantics.time_bounds import StepRange, Window

__all__ = ["exists", "forall", "witness"]


def forall(context: Context, path: PathFormula[StateSet]) -> StateSet:
    """States all of whose paths satisfy the formula.

    Raises:
        UnsupportedError: as for `exists`.
    """
    return ~exists(context, negated(path))


def exists(context: Context, path: PathFormula[StateSet]) -> StateSet:
    """States with a path that satisfies the formula (in an MDP, under some strategy).

    Raises:
        UnsupportedError: there are bounds on rewards, or on time in a CTMC, or the automaton would
            be too large.
    """
    engine = context.engine
    match path:
        case StatePath(states, negative):
            return ~states if negative else states
        case RewardPath():
            raise UnsupportedError(
                "A and E with a bound on a reward are not supported; P>0 and P>=1 are"
            )
        case LtlPathFormula():
            return _exists_linear(context, path)
        case NextPath(target, window, negative):
            steps = _steps(context, window)
            if steps.lower > 1 or (steps.upper is not None and steps.upper < 1):
                return engine.all if negative else engine.none
            return engine.graph.predecessors(~target if negative else target)
        case UntilPath(left, right, window, negative):
            steps = _steps(context, window)
            return (
                _exists_not_until(engine.graph, left, right, steps)
                if negative
                else _exists_until(engine.graph, left, right, steps)
            )
        case _:
            assert_never(path)


def _steps(context: Context, window: Window) -> StepRange:
    if not window.is_unbounded and context.engine.model.type.continuous_time:
        raise UnsupportedError(
            "A and E with a bound on time are not supported in continuous time; P>0 and P>=1 are"
        )
    return window.steps()


def _exists_until(graph: Graph, left: StateSet, right: StateSet, steps: StepRange) -> StateSet:
    """E [ left U[a,b] right ]: a steps in `left`, then `left U<=b-a right`."""
    if steps.upper is None:
        result = graph.exists_until(left, right)
    else:
        result = _repeated(
            lambda states: states | (left & graph.predecessors(states)),
            right,
            steps.upper - steps.lower,
        )
    return _repeated(lambda states: left & graph.predecessors(states), result, steps.lower)


def _exists_not_until(graph: Graph, left: StateSet, right: StateSet, steps: StepRange) -> StateSet:
    """E [ !(left U[a,b] right) ]: `right` never holds, or `left` ends before it."""
    if steps.upper is None:
        result = graph.exists_globally(~right) | graph.exists_until(~right, ~(left | right))
    else:
        result = _repeated(
            lambda states: states & (~left | graph.predecessors(states)),
            ~right,
            steps.upper - steps.lower,
        )
    return _repeated(lambda states: ~left | graph.predecessors(states), result, steps.lower)


def _repeated(
    step: Callable[[StateSet], StateSet], states: StateSet, times: int | None = None
) -> StateSet:
    """The result of applying a step `times` times, or until a fixpoint is reached."""
    for _ in count() if times is None else range(times):
        before, states = states, step(states)
        if states == before:
            break
    return states


def _exists_linear(context: Context, path: LtlPathFormula[StateSet]) -> StateSet:
    """States with a path that an automaton of the formula accepts."""
    from symcheck.check.omega_regular.ltl import linear_product

    product, pairs = linear_product(context, path)
    engine = product.engine
    recurrent = (_visits_infinitely_often(engine.graph, ~avoid, visits) for avoid, visits in pairs)
    return product.project_set(
        engine.graph.exists_until(engine.all, reduce(or_, recurrent, engine.none))
    )


def _visits_infinitely_often(
    graph: Graph, within: StateSet, visits: Sequence[StateSet]
) -> StateSet:
    """States with a path that stays in `within` and visits each set of `visits` infinitely often.

    The greatest fixpoint of the states from which each set can be reached in at least one step
    inside the fixpoint. Each round also removes all states without an infinite path, as acyclic
    paths would otherwise lose only one state per round.
    """

    def refine(result: StateSet) -> StateSet:
        each = (graph.predecessors(graph.exists_until(result, result & s)) for s in visits)
        return graph.exists_globally(reduce(and_, each, result))

    result = graph.exists_globally(within)
    return _repeated(refine, result) if visits else result


def witness(
    context: Context, path: PathFormula[StateSet]
) -> Sequence[Mapping[str, int | bool]] | None:
    """A shortest finite path from an initial state that shows E [ path ]; None if there is none."""
    match path:
        case UntilPath(left, right, window, False) if window.is_unbounded:
            return context.engine.graph.witness(left, right)
        case UntilPath(left, right, window, True) if window.is_unbounded:
            return context.engine.graph.witness(~right, ~(left | right))
        case UntilPath() | StatePath() | NextPath() | LtlPathFormula() | RewardPath():
            return None
        case _:
            assert_never(path)
