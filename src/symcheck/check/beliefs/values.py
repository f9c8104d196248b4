"""The values of queries about partially observed models, and comparisons with thresholds."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np

from symcheck.check import tuning
from symcheck.check.beliefs.engine import engine_of, rows_matrix
from symcheck.check.beliefs.model import observed_model, require_observable
from symcheck.check.beliefs.search import Enough, Problem, search
from symcheck.check.context import Context
from symcheck.check.queries.path_probabilities import probability
from symcheck.check.result import SolverRun
from symcheck.check.thresholds import decide
from symcheck.engines.base import StateSet, Values
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Floats
from symcheck.numerics.beliefs.exploration import Exploration
from symcheck.numerics.beliefs.observed import GOAL
from symcheck.numerics.linear.problem import largest_width
from symcheck.semantics.features import class_name
from symcheck.semantics.path_formulas import NextPath, StatePath, UntilPath
from symcheck.semantics.query import PathProbability, Query, ReachReward, Threshold

__all__ = ["belief_values", "decided_by_beliefs", "problem_of"]


def problem_of(context: Context, query: Query[StateSet]) -> tuple[Problem, bool] | None:
    """What a query asks of beliefs, and whether its value is 1 minus the answer.

    None if it is not about reaching states without a bound.

    Raises:
        InputError: the states to be reached are not observable.
        UnsupportedError: the query is of another kind.
    """
    quantity, direction = query.quantity, query.direction
    assert direction is not None
    engine = context.engine
    match quantity:
        case PathProbability(UntilPath(left, right, window, negative)) if window.is_unbounded:
            model = observed_model(context)
            through, to = (require_observable(model, s, engine) for s in (left | right, right))
            towards = direction.dual if negative else direction
            return Problem(model, through, to, None, towards), negative
        case ReachReward(reward, target):
            model = observed_model(context)
            members = require_observable(model, target, engine)
            return Problem(model, np.ones_like(members), members, reward, direction), False
        case PathProbability(UntilPath() | NextPath() | StatePath()):
            return None
        case _:
            raise UnsupportedError(
                f"{quantity.called} are not supported for {class_name(engine.model)}"
            )


def belief_values(context: Context, query: Query[StateSet]) -> Values:
    """The values of a query, of which the relevant ones are bounded as closely as is affordable.

    The value of a state is that of the runs that begin there, if this is known.

    Raises:
        InputError: the states to be reached are not observable.
        UnsupportedError: the query is of another kind, or a bound on steps admits too many beliefs.
        NumericalError: in rational arithmetic, there are too many beliefs.
    """
    epsilon = context.options.epsilon

    def enough(lower: Floats, upper: Floats) -> bool:
        return largest_width(lower, upper, context.options.relative) <= epsilon

    values, widest = _values(context, query, enough)
    if widest > epsilon:
        context.log.wide = True
        context.log.warn(
            f"the bounds are {widest:.1E} apart: more beliefs (-beliefs, -gridresolution) may "
            "narrow them, but that they ever meet is not promised for partially observed models"
        )
    return values


def decided_by_beliefs(context: Context, query: Query[StateSet], relevant: StateSet) -> StateSet:
    """The states that satisfy the threshold of a query; right at the relevant ones.

    Raises NumericalError if bounds do not decide it.
    """
    threshold = query.threshold
    assert threshold is not None
    decides = _decides(query, threshold)

    def compute(c: Context) -> Values:
        values, widest = _values(c, query, decides)
        undecided = values.compare(threshold.operator.value, threshold.value)[1] & relevant
        if undecided and widest > 1e-9:
            low, high = values.at(c.engine.first(undecided))
            raise NumericalError(
                f"undecided: the value in state {c.example(undecided)} lies between "
                f"{low[0]:.9g} and {high[0]:.9g}, and is compared with "
                f"{float(threshold.value):.9g}",
                hint="-beliefs and -gridresolution explore more; whether it helps is undecidable",
            )
        return values

    def exactly() -> StateSet:
        from symcheck.check.exact_twin import exact_twin

        exact = exact_twin(context)
        twin = query.over(lambda s: exact.engine.from_bools(context.engine.to_bools(s)))
        members = exact.engine.from_bools(context.engine.to_bools(relevant))
        values, _ = _values(exact.relevant_at(members), twin, lambda *_: False)
        sure = values.compare(threshold.operator.value, threshold.value)[0]
        return context.engine.from_bools(exact.engine.to_bools(sure))

    return decide(context, compute, threshold.operator.value, threshold.value, relevant, exactly)


def _decides(query: Query[StateSet], threshold: Threshold) -> Enough:
    negative = isinstance(query.quantity, PathProbability) and query.quantity.path.negative

    def decides(lower: Floats, upper: Floats) -> bool:
        if negative:
            lower, upper = 1 - upper, 1 - lower
        return all(
            threshold.admits(a) == threshold.admits(b)
            for a, b in zip(lower.tolist(), upper.tolist(), strict=True)
        )

    return decides


def _values(context: Context, query: Query[StateSet], enough: Enough) -> tuple[Values, float]:
    """The values, and the largest distance of bounds at relevant states."""
    engine, quantity = context.engine, query.quantity
    if isinstance(quantity, PathProbability) and isinstance(quantity.path, StatePath):
        return probability(context, quantity.path, query.direction), 0.0
    asked = problem_of(context, query)
    relevant = engine.all if context.relevant_states is None else context.relevant_states
    states = np.flatnonzero(engine.to_bools(relevant))
    if asked is None:
        return _within_steps(context, query, relevant), 0.0
    problem, complement = asked
    parts = [search(context, problem, states[i : i + 1], enough) for i in range(len(states))]
    for found in parts:
        context.log.runs.append(SolverRun("linear", "beliefs", found.beliefs, 1, found.text))
    context.log.kept.append((("beliefs", id(engine)), (problem, parts[-1], states)))
    lower = np.concatenate([p.lower for p in parts])
    upper = np.concatenate([p.upper for p in parts])
    rounded = any(p.rounded for p in parts)
    if complement:
        lower, upper = 1 - upper, 1 - lower
        if not engine.is_rational:  # differences are rounded, but for those that are 0 and 1
            lower = np.where(lower % 1 > 0, np.nextafter(lower, 0), lower)
            upper = np.where(upper % 1 > 0, np.nextafter(upper, 1), upper)
    most = 1 if problem.reward is None else inf
    values = _spread(context, relevant, lower, upper, rounded, most)
    if engine.is_rational:
        return values, 0.0
    return values, largest_width(lower, upper, context.options.relative)


def _spread(
    context: Context,
    states: StateSet,
    lower: Numbers,
    upper: Numbers,
    rounded: bool,
    most: float = 1,
) -> Values:
    """Values of some states; those of the others are unknown, from 0 to `most`."""
    engine = context.engine
    values = engine.system(states).lift(
        lower, None if engine.is_rational else upper, up_to_rounding=rounded
    )
    others = engine.constant(nan) if engine.is_rational else engine.constant(0, most)
    return values.choose(states, others)


# ------------------------------------------------------------------------------------ bounded paths


def _within_steps(context: Context, query: Query[StateSet], asked: StateSet) -> Values:
    """Values that so many steps decide, by all beliefs that are met within them."""
    quantity, direction = query.quantity, query.direction
    assert isinstance(quantity, PathProbability)
    path = quantity.path
    assert isinstance(path, UntilPath | NextPath)
    model = observed_model(context)
    settled = model.arrays
    if isinstance(path, NextPath):
        levels = 1
        sets = [require_observable(model, path.target, context.engine)]
    else:
        steps = path.window.steps().upper
        if steps is None:
            raise UnsupportedError(
                "bounds on steps from below are not supported for "
                f"{class_name(context.engine.model)} without one from above"
            )
        levels = steps
        at_once = path.window.contains_zero
        left = path.left | path.right if at_once else path.left
        sets = [require_observable(model, s, context.engine) for s in (left, path.right)]
        if at_once:
            settled = settled.settled(sets[1], ~sets[0])
    found = Exploration(settled, rational=context.engine.is_rational)
    points = found.points(np.flatnonzero(context.engine.to_bools(asked)))
    if not found.run(tuning.BOUNDED_BELIEFS, levels=levels):
        raise UnsupportedError(
            f"more than {tuning.BOUNDED_BELIEFS:,} beliefs are possible within {levels} steps"
        )
    matrix, _ = rows_matrix(found.rows(), None, reward=False)
    relevant = np.zeros(len(found), np.bool_)
    relevant[points] = True
    inner = context.within(engine_of(model.engine, matrix), relevant)
    over = [_of_beliefs(found, s) for s in sets]
    node_path = (
        replace(path, target=ArraySet(over[0]))
        if isinstance(path, NextPath)
        else replace(path, left=ArraySet(over[0]), right=ArraySet(over[1]))
    )
    values = probability(inner, node_path, direction)
    context.log.runs.append(
        SolverRun("steps", "beliefs", len(found), levels, f"all {len(found):,} beliefs")
    )
    low, high = values.at(ArraySet(relevant))
    at = np.searchsorted(np.flatnonzero(relevant), points)
    return _spread(context, asked, low[at], high[at], values.rounded(ArraySet(relevant)))


def _of_beliefs(found: Exploration, members: Bools) -> Bools:
    """The beliefs of whose states these observable ones are all; GOAL is one of them."""
    beliefs = found.beliefs
    out = np.zeros(len(found), np.bool_)
    out[GOAL] = True
    filled = np.flatnonzero(np.diff(beliefs.starts) > 0)
    out[filled] = members[beliefs.states[beliefs.starts[filled]]]
    return out
