"""Which paths show the truth of a bound, and how much they must show together.

An upper bound is broken by paths that satisfy the path formula, a lower bound by paths that violate
it, if they have enough probability together (Han, Katoen & Damman 2009). In an MDP they are those
of a strategy that makes them as likely as possible; such a strategy also shows that a bound on the
best case holds, but no set of paths shows what holds under every strategy.

Paths that violate `left U right` reach a state from which it cannot be satisfied any more, or use
up the steps that it has. With bounds on rewards, paths are those of the product with counters,
which show that a bound is exceeded. Other LTL formulas are those of the product with an automaton:
a path ends where the formula is satisfied almost surely. A path within a time bound counts with the
probability that a CTMC runs it in time, a path to the target of a reward (of all steps of `C<=k`)
with what it earns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import TypeVar, assert_never

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measures.reward_bounded_until import row_rewards
from symcheck.check.measures.reward_scaling import scale_bound
from symcheck.check.omega_regular.ltl import accepted_states, linear_product
from symcheck.check.state_formulas import query_of, satisfying
from symcheck.check.strategies.counters import counter_product
from symcheck.check.strategies.strategy import strategy_attaining, temporal_strategy
from symcheck.check.strategies.to_explicit import rows_engine
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ExplicitProduct, ProductModel
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.likeliest_paths import FoundPath, StepProblem, WalkProblem
from symcheck.numerics.transient.phase_type import least_probability_within
from symcheck.options import Options
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
    as_ltl,
    negated,
)
from symcheck.semantics.query import CumulativeReward, PathProbability, Query, ReachReward
from symcheck.semantics.query import query_of as query_of_text
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import (
    ExpectedTime,
    Expression,
    ProbabilityOperator,
    RewardOperator,
    letters_of,
)

__all__ = ["PathSearch", "is_explained", "path_search"]

L = TypeVar("L")
Number = float | Fraction
_Explained = ProbabilityOperator | RewardOperator | ExpectedTime


@dataclass(frozen=True, eq=False)
class PathSearch:
    """Which paths are looked for.

    Attributes:
        engine: the model.
        problem: the walks that are paths.
        initial: the state of the problem in which they begin.
        satisfies: whether they satisfy the path formula.
        refutes: whether they show that the property is false.
        threshold: what their sum has to reach, or with `strict` to exceed.
        strict: see `threshold`.
        rows: the row of the engine that a strategy takes in each state of the problem; None for
            chains, and where it depends on the number of steps.
        origin: the state of the engine of each state of the problem; None: the same.
        reward: what a path earns; None for a bound on a probability.
        structure: which reward it earns.
        probability_in_time: the probability that a path is taken in time; None: without a bound.
        note: what else there is to say.
    """

    engine: ExplicitEngine
    problem: WalkProblem | StepProblem
    initial: int
    satisfies: bool
    refutes: bool = False
    threshold: Fraction = Fraction(0)
    strict: bool = False
    rows: Int64s | None = None
    origin: Int64s | None = None
    reward: Callable[[FoundPath], Number] | None = None
    structure: Reward | None = None
    probability_in_time: Callable[[FoundPath], float] | None = None
    note: str = ""


def path_search(context: Context, formula: Expression) -> PathSearch:
    """What has to be shown, and by which paths.

    Args:
        context: the explicit engine, the options and the log.
        formula: the property.

    Raises:
        UnsupportedError: no set of paths shows the value of the formula.
    """
    engine = rows_engine(context)
    formula = _bounded_measure(formula, context.options)
    initial = context.engine.initial
    holds = satisfying(context, formula, initial)
    query = query_of(context, formula)
    assert query.threshold is not None
    broken = initial - holds
    refutes = bool(broken)
    satisfies = _showing(query, context.engine.model, refutes=refutes)
    first = int(np.argmax(context.engine.to_bools(broken if refutes else initial)))
    strict = (query.threshold.operator.value in ("<=", ">=")) == refutes
    threshold = query.threshold.value
    if isinstance(query.quantity, PathProbability):
        # P(path) > p breaks <= p; P(not path) > 1 - p breaks >= p; and so on.
        threshold = threshold if satisfies else 1 - threshold
        path = query.quantity.path
        search = _probability(context, engine, query, path, first, satisfies=satisfies)
    else:
        search = _reward(context, engine, query, first)
        if not search.satisfies:
            threshold, strict = Fraction(0), True
    return replace(search, refutes=refutes, threshold=threshold, strict=strict)


def is_explained(formula: Expression, model: BoundModel, options: Options, *, holds: bool) -> bool:
    """Whether `path_search` explains that a formula holds, or does not, as far as the text tells.

    It may still find that the states are too many, or a reward negative.
    """
    try:
        require(model, Feature.COUNTEREXAMPLES)
        query = query_of_text(_bounded_measure(formula, options), model)
        _showing(query, model, refutes=not holds)
    except UnsupportedError:
        return False
    return True


def _bounded_measure(formula: Expression, options: Options) -> _Explained:
    """The formula, if it is of a kind that paths explain. Raises UnsupportedError."""
    if not isinstance(formula, _Explained) or formula.bound is None:
        raise UnsupportedError(
            f"counterexamples are for {letters_of(_Explained)} with a bound, such as "
            "P<=0.1 [ F states ] or R<=3 [ F states ]"
        )
    if options.fairness:
        raise UnsupportedError("counterexamples are not supported with -fair")
    return formula


def _showing(query: Query[L], model: BoundModel, *, refutes: bool) -> bool:
    """Whether the paths satisfy the path formula that show the value of a bound.

    Raises UnsupportedError: no finite set of paths shows it, or none that is looked for.
    """
    assert query.threshold is not None
    # An upper bound that is broken, and a lower bound that holds, are shown by what is there.
    satisfies = query.threshold.operator.is_lower_bound is not refutes
    if query.direction is not None and (query.direction is Direction.MAX) is not satisfies:
        raise UnsupportedError(
            f"the property is {str(not refutes).lower()} because of every strategy, and paths "
            "belong to one",
            hint=f"a counterexample exists if the property is {str(refutes).lower()}",
        )
    quantity, kind = query.quantity, model.type
    if isinstance(quantity, PathProbability):
        _require_paths(quantity.path if satisfies else negated(quantity.path), model)
        return satisfies
    timed = isinstance(quantity, CumulativeReward) and kind.continuous_time
    if timed or not isinstance(quantity, CumulativeReward | ReachReward):
        raise UnsupportedError(
            "counterexamples of expected rewards are supported for F states: R<=r [ F states ], "
            "and in discrete time for R<=r [ C<=k ]"
        )
    if not satisfies:
        raise UnsupportedError(
            "no finite set of paths shows that an expected reward is small",
            hint="R<=r [ F states ] that is false, and R>=r [ F states ] that is true have one",
        )
    return satisfies


def _require_paths(path: PathFormula[L], model: BoundModel) -> None:
    """Raise UnsupportedError for a path formula whose paths are not looked for."""
    match path:
        case UntilPath(window=window) if model.type.continuous_time and not window.is_unbounded:
            if path.negative or not window.contains_zero:
                raise UnsupportedError(
                    "counterexamples of time bounds are supported for F<=t and U<=t whose paths "
                    "satisfy the formula: P<=p [ F<=t a ] that is false, P>=p [ F<=t a ] that is "
                    "true"
                )
            if model.is_rational:
                raise UnsupportedError(
                    "counterexamples of time bounds are not supported with -exact"
                )
        case NextPath(window=window) if model.type.continuous_time and not window.is_unbounded:
            raise UnsupportedError("counterexamples are not supported for X with a time bound")
        case RewardPath(NextPath()) if model.type.has_choices:
            raise UnsupportedError(
                "counterexamples of X with a bound on a reward are supported for chains; those "
                "of F, G, U, W and R for MDPs too"
            )


# ------------------------------------------------------------------------------- probabilities


def _probability(
    context: Context,
    engine: ExplicitEngine,
    query: Query[StateSet],
    whole: PathFormula[StateSet],
    first: int,
    *,
    satisfies: bool,
) -> PathSearch:
    path = whole if satisfies else negated(whole)
    match path:
        case NextPath(target, window, negative) if window.is_unbounded:
            end = context.engine.to_bools(~target if negative else target)
            everything, nothing = np.ones_like(end), np.zeros_like(end)
            steps = StepProblem(engine.matrix, everything, nothing, end, 1)
            return PathSearch(engine, steps, first, satisfies)
        case UntilPath(window=window) if window.is_unbounded:
            rows, matrix = None, engine.matrix
            if engine.model.type.has_choices:
                rows = strategy_attaining(context, query).rows
                matrix = matrix.choose(rows)
            passing, goal, _ = _until(context, matrix, path)
            if rows is not None and path.negative and goal[first]:
                left, right = map(context.engine.to_bools, (path.left, path.right))
                goal = _given_up(engine.matrix, matrix, left, right, goal)
                passing = left & ~right & ~goal
            problem = WalkProblem(matrix, passing, goal)
            return PathSearch(engine, problem, first, satisfies, rows=rows)
        case UntilPath(window=window) if engine.model.type.continuous_time:
            passing, goal, _ = _until(context, engine.weights, path)
            problem = WalkProblem(engine.matrix, passing, goal)
            in_time = _within(engine, window.times()[1])
            return PathSearch(engine, problem, first, satisfies, probability_in_time=in_time)
        case UntilPath(window=window) if window.contains_zero:
            return PathSearch(engine, _bounded(context, engine.matrix, path), first, satisfies)
        case RewardPath():
            return _within_rewards(context, engine, query, path, first, satisfies=satisfies)
        case NextPath() | UntilPath() | LtlPathFormula() | StatePath():
            ltl = replace(as_ltl(whole), negative=not satisfies)
            return _on_product(context, engine, ltl, first)
        case _:
            assert_never(path)


def _until(
    context: Context, matrix: SparseMatrix, path: UntilPath[StateSet]
) -> tuple[Bools, Bools, Bools]:
    """Where paths may pass, where they end, and where they may be after all steps."""
    to = context.engine.to_bools
    passing, goal, end = to(path.left), to(path.right), to(context.engine.none)
    if path.negative:
        return *_missed(matrix, passing, goal), ~goal
    return passing, goal, end


def _missed(matrix: SparseMatrix, passing: Bools, goal: Bools) -> tuple[Bools, Bools]:
    """Where paths that violate an until formula pass, and where they end."""
    impossible = graph.prob0(matrix, passing, goal, Direction.MAX)
    return passing & ~goal & ~impossible, impossible


def _given_up(
    whole: SparseMatrix, chosen: SparseMatrix, left: Bools, right: Bools, lost: Bools
) -> Bools:
    """Where paths end that a strategy loses from their first state on: where every strategy has
    lost, which shows what went wrong, if the paths get there almost surely.

    whole, chosen: the matrix of the model, and that of the strategy. lost: where this has lost.
    """
    never = graph.prob0(whole, left, right, Direction.MAX)
    return never | (lost & ~graph.prob1(chosen, lost, never))


def _bounded(context: Context, matrix: SparseMatrix, path: UntilPath[StateSet]) -> StepProblem:
    return StepProblem(matrix, *_until(context, matrix, path), _steps(matrix, path.window))


def _steps(matrix: SparseMatrix, window: Window) -> int:
    """The most steps of a path."""
    steps = window.steps().upper
    assert steps is not None
    if (steps + 1) * matrix.states > tuning.PATH_STEPS:
        raise UnsupportedError(
            f"{steps:,} steps of {matrix.states:,} states are too many for a counterexample"
        )
    return steps


def _within(engine: ExplicitEngine, time: float | None) -> Callable[[FoundPath], float]:
    """The probability that a path of a CTMC takes at most a time, from below."""
    assert time is not None
    exit_rates = engine.system(engine.all).exit_rates
    assert exit_rates is not None

    @cache
    def of_rates(rates: tuple[float, ...]) -> float:
        return least_probability_within(rates, time)

    return lambda path: of_rates(tuple(sorted(exit_rates[list(path.states[:-1])].tolist())))


def _within_rewards(
    context: Context,
    engine: ExplicitEngine,
    query: Query[StateSet],
    path: RewardPath[StateSet],
    first: int,
    *,
    satisfies: bool,
) -> PathSearch:
    """Paths with bounds on rewards: those of the product with a counter for each reward."""
    has_choices, to = engine.model.type.has_choices, context.engine.to_bools
    system = context.engine.system(context.engine.all)
    bounds = [scale_bound(context, system, row_rewards(context, system, c), c) for c in path.counts]
    product = counter_product(engine, bounds, "a counterexample")
    matrix, rows = product.engine.matrix, None
    problem: WalkProblem | StepProblem
    match path.path:
        case NextPath(target):
            end = to(target)[product.state] & product.met
            everything, nothing = np.ones_like(end), np.zeros_like(end)
            end = ~end if path.negative else end
            problem = StepProblem(matrix, everything, nothing, end, 1)
        case UntilPath(left, right):
            if has_choices:
                rows = strategy_attaining(context, query).rows
                matrix = matrix.choose(rows)
            passing = to(left)[product.state] & product.within
            goal = to(right)[product.state] & product.met
            if path.negative:
                passing, goal = _missed(matrix, passing, goal)
            problem = WalkProblem(matrix, passing, goal)
    explored = product.engine.explored
    assert isinstance(explored, ProductModel)
    rows = explored.rows if rows is None else explored.rows[rows]
    origin = product.state.astype(np.int64)
    return PathSearch(
        engine, problem, int(product.entry[first]), satisfies, rows=rows, origin=origin
    )


def _on_product(
    context: Context, engine: ExplicitEngine, path: LtlPathFormula[StateSet], first: int
) -> PathSearch:
    """Paths after which an LTL formula holds almost surely."""
    if engine.model.type.has_choices:
        direction = Direction.MIN if path.negative else Direction.MAX
        strategy, accepted = temporal_strategy(context, replace(path, negative=False), direction)
        product, matrix, entry = strategy.engine, strategy.induced, strategy.entry
        rows: Int64s | None = strategy.rows
        inner = context.on(erased(product))
        good = inner.engine.to_bools(accepted)
    else:
        of_path, pairs = linear_product(context, path)
        assert isinstance(of_path, ExplicitProduct)
        inner = context.on(of_path.engine)
        product, entry, rows = rows_engine(inner), of_path.entry, None
        matrix = product.matrix
        good = inner.engine.to_bools(accepted_states(inner, context, of_path, pairs))
    assert entry is not None
    everything = np.ones(product.states, np.bool_)
    sure = graph.prob1(matrix, everything, good)
    explored = product.explored
    assert isinstance(explored, ProductModel)
    problem = WalkProblem(matrix, everything, sure)
    rows = explored.rows if rows is None else explored.rows[rows]
    origin = explored.state.astype(np.int64)
    return PathSearch(
        engine, problem, int(entry[first]), not path.negative, rows=rows, origin=origin
    )


# ------------------------------------------------------------------------------------- rewards


def _reward(
    context: Context,
    engine: ExplicitEngine,
    query: Query[StateSet],
    first: int,
) -> PathSearch:
    """Paths to the target of an expected reward, or one that misses it; those of `C<=k`."""
    quantity = query.quantity
    assert isinstance(quantity, CumulativeReward | ReachReward)
    earned = context.engine.system(context.engine.all).step_rewards(quantity.reward)
    rows, matrix = None, engine.matrix
    everything = np.ones(engine.states, np.bool_)
    start = ~everything
    start[first] = True
    problem: WalkProblem | StepProblem
    if isinstance(quantity, CumulativeReward):
        steps, target = _steps(matrix, quantity.window), ~everything
        problem = StepProblem(matrix, everything, target, everything, steps, earned)
        reached = graph.forward_reachable(matrix, start, everything)
    else:
        target = context.engine.to_bools(quantity.target)
        if engine.model.type.has_choices:
            rows = strategy_attaining(context, query).rows
            matrix, earned = matrix.choose(rows), earned[rows]
        problem = WalkProblem(matrix, ~target, target)
        reached = graph.forward_reachable(matrix, start, ~target)
        missed = graph.prob0(matrix, everything, target) & reached
        if missed.any():
            problem = WalkProblem(matrix, ~target & ~missed, missed)
            note = "the expected reward is infinite, because the target is missed"
            return PathSearch(engine, problem, first, False, rows=rows, note=note)
    if (earned[matrix.rows_of(reached & ~target)] < 0).any():
        raise UnsupportedError("counterexamples are not supported for negative rewards")
    return PathSearch(
        engine,
        problem,
        first,
        satisfies=True,
        rows=rows,
        reward=lambda path: sum(earned[list(path.rows)].tolist()),
        structure=quantity.reward,
    )
