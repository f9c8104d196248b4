"""The values of queries about partially observed models, and comparisons with thresholds."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf, nan

import numpy as np

from symcheck.check import tuning
from symcheck.check.beliefs.engine import engine_of, rows_matrix
from symcheck.check.beliefs.model import observed_model, require_observable
from symcheck.check.beliefs.search import Enough, Found, Plan, Problem, search
from symcheck.check.context import Context
from symcheck.check.queries.path_probabilities import probability
from symcheck.check.result import SolverRun
from symcheck.check.thresholds import decide
from symcheck.engines.base import StateSet, Values
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.rows import Floats, Int64s
from symcheck.numerics.beliefs.exploration import Exploration
from symcheck.numerics.linear.problem import largest_width
from symcheck.semantics.features import class_name
from symcheck.semantics.path_formulas import NextPath, StatePath, UntilPath
from symcheck.semantics.query import PathProbability, Query, ReachReward, query_of
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import AnyMeasure, Expression

__all__ = ["belief_values", "decided_by_beliefs"]


def belief_values(context: Context, formula: AnyMeasure, query: Query[StateSet]) -> Values:
    """The values of a query, of which the relevant ones are bounded as closely as is affordable.

    The value of a state is that of the runs that begin there, if this is known.

    Raises:
        InputError: the states to be reached are not observable.
        UnsupportedError: the query is of another kind, or a bound on steps admits too many beliefs.
        NumericalError: in rational arithmetic, there are too many beliefs.
    """
    _require_observable(context, formula, query)
    epsilon = context.options.epsilon

    def enough(lower: Floats, upper: Floats) -> bool:
        return largest_width(lower, upper, context.options.relative) <= epsilon

    values, widest = _values(context, query, enough)
    context.warn_if_wide(
        widest,
        "more beliefs (-beliefs, -gridresolution) may narrow them, but that they ever meet is not "
        "promised for partially observed models",
    )
    return values


def decided_by_beliefs(
    context: Context, formula: AnyMeasure, query: Query[StateSet], relevant: StateSet
) -> StateSet:
    """The states that satisfy the threshold of a query; right at the relevant ones.

    Raises NumericalError if bounds do not decide it.
    """
    _require_observable(context, formula, query)
    threshold = query.threshold
    assert threshold is not None

    def decides(lower: Floats, upper: Floats) -> bool:
        pairs = zip(lower.tolist(), upper.tolist(), strict=True)
        return all(threshold.admits(a) == threshold.admits(b) for a, b in pairs)

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


def _require_observable(context: Context, formula: AnyMeasure, query: Query[StateSet]) -> None:
    """Require that a query is about reaching observable states."""
    engine = context.engine
    match query.quantity:
        case PathProbability(UntilPath() | NextPath()) | ReachReward():
            model = observed_model(context)
            texts: list[Expression] = []
            sets: list[StateSet] = []
            query_of(formula, engine.model).over(texts.append)
            query.over(sets.append)
            for text, states in zip(texts, sets, strict=True):
                require_observable(model, text, engine.to_bools(states))
        case PathProbability(StatePath()):
            pass
        case quantity:
            raise UnsupportedError(
                f"{quantity.called} are not supported for {class_name(engine.model)}"
            )


def _problem(context: Context, query: Query[StateSet]) -> Problem | None:
    """What a query asks of beliefs; None if the first state decides it."""
    quantity, direction, to = query.quantity, query.direction, context.engine.to_bools
    assert direction is not None
    if isinstance(quantity, ReachReward):
        members = to(quantity.target)
        everywhere = np.ones_like(members)
        return Problem(observed_model(context), everywhere, members, quantity.reward, direction)
    assert isinstance(quantity, PathProbability)
    path = quantity.path
    if isinstance(path, NextPath):
        steps, one = path.window.steps(), Fraction(1)
        target = path.target if steps.lower <= 1 and steps.upper != 0 else context.engine.none
        path = UntilPath(context.engine.all, target, Window(one, one), path.negative)
    if not isinstance(path, UntilPath):
        return None
    left = path.left | path.right if path.window.contains_zero else path.left
    return Problem(
        observed_model(context),
        to(left),
        to(path.right),
        None,
        direction,
        path.window,
        path.negative,
    )


def _values(context: Context, query: Query[StateSet], enough: Enough) -> tuple[Values, float]:
    """The values, and the largest distance of bounds at relevant states."""
    engine, problem = context.engine, _problem(context, query)
    if problem is None:
        assert isinstance(query.quantity, PathProbability)
        return probability(context, query.quantity.path, query.direction), 0.0
    relevant = engine.all if context.relevant_states is None else context.relevant_states
    states = np.flatnonzero(engine.to_bools(relevant))
    bounded, steps = not problem.window.is_unbounded, problem.window.steps().upper
    if not bounded:
        parts = [search(context, problem, states[i : i + 1], enough) for i in range(len(states))]
    else:
        parts = [_within_steps(context, problem, states)]
    kind = "steps" if bounded else "linear"
    for found in parts:
        run = SolverRun(kind, "beliefs", found.beliefs, steps or 1, found.text)
        context.log.runs.append(run)
    lower = np.concatenate([p.lower for p in parts])
    upper = np.concatenate([p.upper for p in parts])
    rounded = any(p.rounded for p in parts)
    solved = replace(parts[-1], lower=lower, upper=upper)
    context.log.kept.append((("beliefs", id(engine)), solved))
    most = 1 if problem.reward is None else inf
    values = engine.system(relevant).lift(
        lower, None if engine.is_rational else upper, up_to_rounding=rounded
    )
    others = engine.constant(nan) if engine.is_rational else engine.constant(0, most)
    decided = bounded or engine.is_rational
    width = 0.0 if decided else largest_width(lower, upper, context.options.relative)
    return values.choose(relevant, others), width


def _within_steps(context: Context, problem: Problem, states: Int64s) -> Found:
    """Values that so many steps decide, by all beliefs that are met within them."""
    model, window = problem.model, problem.window
    steps = window.steps().upper
    if steps is None:
        raise UnsupportedError(
            "bounds on steps from below are not supported for "
            f"{class_name(context.engine.model)} without one from above"
        )
    settled = model.arrays
    if window.contains_zero:
        settled = settled.settled(problem.right, ~problem.left)
    found = Exploration(settled, rational=context.engine.is_rational)
    points = found.points(states)
    if not found.run(tuning.BOUNDED_BELIEFS, levels=steps):
        raise UnsupportedError(
            f"more than {tuning.BOUNDED_BELIEFS:,} beliefs are possible within {steps} steps"
        )
    matrix, _ = rows_matrix(found.rows(), None, reward=False)
    relevant = np.zeros(len(found), np.bool_)
    relevant[points] = True
    inner = context.within(engine_of(model.engine, matrix), relevant)
    values = probability(inner, problem.path(found.beliefs.within), problem.direction)
    low, high = values.at(inner.engine.all)
    text, plan = f"all {len(found):,} beliefs", Plan(problem, points, found, None)
    rounded = values.rounded(ArraySet(relevant))
    return Found(low[points], high[points], rounded, text, len(found), plan)
