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
from symcheck.check.path_formulas import (
    NextPath,
    Path,
    RewardPath,
    StatePath,
    TemporalPath,
    UntilPath,
    negated,
)
from symcheck.engines.base import Graph, StateSet
from symcheck.errors import UnsupportedError
from symcheck.semantics.time_bounds import Steps, Window
from symcheck.syntax.ast import ModelType

__all__ = ["exists", "forall", "witness"]


def forall(context: Context, path: Path) -> StateSet:
    """States all of whose paths satisfy the formula. Raises UnsupportedError as `exists`."""
    return ~exists(context, negated(path))


def exists(context: Context, path: Path) -> StateSet:
    """States with a path that satisfies the formula (of an MDP: under some choices).

    Raises UnsupportedError for bounds on rewards, on time in a CTMC, and for automata that would be
    too large.
    """
    engine = context.engine
    match path:
        case StatePath(states, negative):
            return ~states if negative else states
        case RewardPath():
            raise UnsupportedError(
                "A and E with a bound on a reward are not supported; P>0 and P>=1 are"
            )
        case TemporalPath():
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


def _steps(context: Context, window: Window) -> Steps:
    if not window.trivial and context.engine.model.type is ModelType.CTMC:
        raise UnsupportedError(
            "A and E with a bound on time are not supported in a ctmc; P>0 and P>=1 are"
        )
    return window.steps()


def _exists_until(graph: Graph, left: StateSet, right: StateSet, steps: Steps) -> StateSet:
    """E [ left U[a,b] right ]: a steps within `left`, then left U<=b-a right."""
    if steps.upper is None:
        found = graph.exists_until(left, right)
    else:
        found = _repeated(
            lambda states: states | (left & graph.predecessors(states)),
            right,
            steps.upper - steps.lower,
        )
    return _repeated(lambda states: left & graph.predecessors(states), found, steps.lower)


def _exists_not_until(graph: Graph, left: StateSet, right: StateSet, steps: Steps) -> StateSet:
    """E [ !(left U[a,b] right) ]: `right` never holds, or `left` ends before it."""
    if steps.upper is None:
        found = graph.exists_globally(~right) | graph.exists_until(~right, ~(left | right))
    else:
        found = _repeated(
            lambda states: states & (~left | graph.predecessors(states)),
            ~right,
            steps.upper - steps.lower,
        )
    return _repeated(lambda states: ~left | graph.predecessors(states), found, steps.lower)


def _repeated(
    step: Callable[[StateSet], StateSet], states: StateSet, times: int | None = None
) -> StateSet:
    """The result of so many steps, or of a fixpoint iteration."""
    for _ in count() if times is None else range(times):
        before, states = states, step(states)
        if states == before:
            break
    return states


def _exists_linear(context: Context, path: TemporalPath) -> StateSet:
    """States with a path that an automaton of the formula accepts."""
    from symcheck.check.omega_regular.ltl import linear_product

    product, pairs = linear_product(context, path)
    engine = product.engine
    for_ever = (_visits_for_ever(engine.graph, ~avoid, visits) for avoid, visits in pairs)
    return product.project_set(
        engine.graph.exists_until(engine.all, reduce(or_, for_ever, engine.none))
    )


def _visits_for_ever(graph: Graph, within: StateSet, visits: Sequence[StateSet]) -> StateSet:
    """States with a path that stays `within` and meets every set of `visits` again and again.

    The greatest set from which each of `visits` can be reached in at least one step without leaving
    it; in between, what has no infinite path in it goes at once, as long chains would else be taken
    apart one state a round.
    """

    def again(found: StateSet) -> StateSet:
        each = (graph.predecessors(graph.exists_until(found, found & states)) for states in visits)
        return graph.exists_globally(reduce(and_, each, found))

    found = graph.exists_globally(within)
    return _repeated(again, found) if visits else found


def witness(context: Context, path: Path) -> Sequence[Mapping[str, int | bool]] | None:
    """A shortest finite path from an initial state that shows E [ path ]; None if there is none."""
    match path:
        case UntilPath(left, right, window, False) if window.trivial:
            return context.engine.graph.witness(left, right)
        case UntilPath(left, right, window, True) if window.trivial:
            return context.engine.graph.witness(~right, ~(left | right))
        case _:
            return None
