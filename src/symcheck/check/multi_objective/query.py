"""Multi-objective queries, `multi(...)`: the values that a strategy of an MDP attains together.

With bounds only, the result is whether some strategy satisfies all of them (achievability). With
one objective without bound (numerical query), it is the optimal value over the strategies that
satisfy the bounds, NaN if there are none. With more (Pareto query), it is the vertices of their
Pareto front. Objectives are P with any LTL formula, R with C, C<=k, S and F states, T with F
states, and S. The reward until F states is what a run earns before it reaches them, also if it
never does. A lexicographic query, `multilex(...)`, optimises its first objective, then the second
one over the strategies that are optimal for the first, and so on.
Source: see `symcheck.numerics.multi_objective.linear_program`.

Linear programs are first solved in floating point. The optimal vertex of a small one is proved in
rational arithmetic, on the model explored exactly. Otherwise numbers are estimates, and a verdict
within the rounding error is an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, isfinite, nan

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.multi_objective.flow import Objective, flow_of
from symcheck.check.multi_objective.linear_query import LinearQuery, is_cost
from symcheck.check.pareto_front import ParetoFront, rounded
from symcheck.check.result import (
    Accuracy,
    Answer,
    Estimate,
    Exact,
    Number,
    Result,
    SolverRun,
    nearest_double,
)
from symcheck.check.state_formulas import query_of
from symcheck.check.strategies.to_explicit import to_explicit
from symcheck.direction import Direction
from symcheck.engines.capabilities import RepresentsOrbits
from symcheck.errors import Diagnostic, InputError, NumericalError, UnsupportedError
from symcheck.matrices.numbers import numbers
from symcheck.numerics import rational_limits
from symcheck.numerics.multi_objective.exact_lp import ROWS
from symcheck.semantics.features import Feature, require
from symcheck.syntax.ast import (
    ExpectedTime,
    Expression,
    MultiObjective,
    ProbabilityOperator,
    RewardOperator,
    SteadyState,
    letters_of,
)
from symcheck.syntax.printer import pretty

__all__ = ["check_multi", "check_supported", "solve_query"]

_AnyObjective = ProbabilityOperator | RewardOperator | ExpectedTime | SteadyState


@dataclass(frozen=True)
class QueryResult:
    """The result of a query.

    close: it is within the rounding error of the linear program. front: of a Pareto query. query:
    the one whose solutions attain the result.
    """

    value: Answer
    about: str
    variables: int
    equations: int
    proved: bool = False
    close: bool = False
    front: ParetoFront | None = None
    query: LinearQuery | None = None


def check_multi(context: Context, formula: MultiObjective) -> Result:
    """The result of a multi-objective query.

    A linear program needs rows: those of a model on diagrams are listed for it.

    Raises:
        InputError: the query is faulty.
        UnsupportedError: an objective is not supported.
        NumericalError: the verdict is within the rounding error.
    """
    check_supported(context, formula)
    if context.engine.is_rational:
        return _result(context, solve_query(context, formula))
    explored = to_explicit(context)
    result = solve_query(explored, formula)
    if (
        result.equations <= (ROWS if result.close else tuning.PROVED_EQUATIONS)
        and explored.engine.states <= rational_limits.STATES
    ):
        try:
            result = _by_rationals(explored, formula)
        except (NumericalError, UnsupportedError) as error:
            if result.close:
                raise _undecided(error) from error
    elif result.close:
        raise _undecided(None)
    remark = "" if explored is context else "; on rows, which a linear program needs"
    return _result(context, replace(result, about=result.about + remark))


def _by_rationals(context: Context, formula: MultiObjective) -> QueryResult:
    """The result on the model explored exactly, with numbers as doubles."""
    from symcheck.check.exact_twin import exact_twin

    result = solve_query(exact_twin(context), formula)
    front, value = result.front, result.value
    if isinstance(value, list):
        value = [tuple(map(rounded, point)) for point in value]
    return replace(result, value=value, front=None if front is None else front.rounded())


def _undecided(error: Exception | None) -> NumericalError:
    reason = (
        "the linear program is too large for rational arithmetic" if error is None else str(error)
    )
    return NumericalError(
        "the bounds are satisfied or violated by less than the rounding error of the linear "
        f"program: not decided ({reason})"
    )


def _result(context: Context, result: QueryResult) -> Result:
    proof = ", proved in rational arithmetic" if result.proved else ""
    note = f"linear program of {result.variables} variables{proof}: {result.about}"
    context.log.runs.append(
        SolverRun(
            "linear",
            "linear program",
            result.variables,
            0,
            note,
            certified=result.proved,
        )
    )
    if not result.proved:
        return Result(result.value, Estimate(), result.about, front_or_none=result.front)
    value: Answer = result.value
    accuracy: Accuracy = Exact(rounding=isinstance(value, list) and not context.engine.is_rational)
    if isinstance(value, Fraction) and not context.engine.is_rational:
        value, accuracy = nearest_double(value)
    return Result(value, accuracy, result.about, front_or_none=result.front)


def solve_query(context: Context, formula: MultiObjective) -> QueryResult:
    """The result on an explicit engine, without a proof of what doubles leave open."""
    objectives = [_objective(context, o) for o in formula.objectives]
    if formula.lexicographic:
        return _lexicographic(context, objectives)
    optimised = [i for i, o in enumerate(objectives) if o.bound is None]
    query = _query(context, objectives, optimised)
    value, about = query.answer()
    close = query.close
    if value is nan and len(optimised) == 1 and is_cost(objectives[optimised[0]]):
        # Either no strategy satisfies the bounds, or each that does has infinite cost.
        others = _query(context, [o for o in objectives if o.bound is not None], ())
        met, _ = others.answer()
        close = others.close
        value, about = (
            (inf, "every strategy that satisfies the bounds has infinite cost")
            if met
            else (value, about)
        )
    flow = query.flow
    size, equations = flow.gains.shape[1], flow.equations + len(objectives)
    return QueryResult(value, about, size, equations, flow.is_rational, close, query.front, query)


def _lexicographic(context: Context, objectives: Sequence[Objective]) -> QueryResult:
    """Optimise one objective after the other; those before keep their optimal values.

    An objective takes part only when its turn comes, because a finite cost is a restriction.

    Source: Chatterjee, Katoen, Mohr, Weininger & Winkler (2023), 'Stochastic games with
    lexicographic objectives', for the notion; the linear programs are those of `multi(...)`.
    """
    fixed = [o for o in objectives if o.bound is not None]
    optimised = [o for o in objectives if o.bound is None]
    if not optimised:
        raise UnsupportedError("multilex(...) needs objectives with =?; multi(...) checks bounds")
    query = _query(context, fixed, ())
    met, about = query.answer()
    close, values, last = query.close, list[Number](), query
    for objective in optimised if met else ():
        query = _query(context, [*fixed, objective], (len(fixed),))
        value, _ = query.answer()
        assert isinstance(value, float | Fraction)
        if value is nan and not (is_cost(objective) and _query(context, fixed, ()).answer()[0]):
            raise NumericalError(
                "an optimum of multilex(...) is not attained within rounding errors"
            )
        # Otherwise each strategy that is optimal so far has infinite cost, and all are equal.
        values.append(inf if value is nan else value)
        last = last if value is nan else query
        if value == inf and objective is not optimised[-1]:
            raise UnsupportedError(
                "an objective of multilex(...) whose reward some strategy collects for ever is "
                "supported in the last place only"
            )
        if isfinite(value):
            fixed.append(replace(objective, bound=Fraction(value)))
    flow = query.flow
    point = [tuple(values)] if met else []
    about = "lexicographic optimum" if met else about
    equations = flow.equations + len(fixed)
    return QueryResult(
        point, about, flow.gains.shape[1], equations, flow.is_rational, close, query=last
    )


def _query(
    context: Context, objectives: Sequence[Objective], optimised: Sequence[int]
) -> LinearQuery:
    product = flow_of(context, objectives)
    least = numbers(
        np.array([o.least for o in objectives], dtype=object), rational=product.flow.is_rational
    )
    return LinearQuery(objectives, optimised, product.engine, product.flow, least)


def check_supported(context: Context, formula: MultiObjective) -> None:
    """Raise InputError or UnsupportedError if the model has no such queries."""
    require(context.engine.model, Feature.MULTI_OBJECTIVE)
    if not context.engine.model.type.has_choices:
        raise InputError(Diagnostic("multi(...) needs an MDP", formula.span, "multi"))
    orbits = context.engine.capability(RepresentsOrbits)
    whole = None if orbits is None else orbits.represented
    if (context.engine.initial.count if whole is None else whole.initial) != 1:
        raise UnsupportedError("multi(...) is not supported for models with several initial states")
    if context.options.fairness:
        raise UnsupportedError("multi(...) is not supported with -fair")


def _objective(context: Context, formula: Expression) -> Objective:
    if not isinstance(formula, _AnyObjective):
        message = f"an objective of multi(...) must be a {letters_of(_AnyObjective, 'or')} operator"
        raise InputError(Diagnostic(message, formula.span, "multi"))
    if formula.bound is None and formula.direction not in ("min", "max"):
        hint = f"write {formula.letter}min=? or {formula.letter}max=?"
        message = "an objective without bound needs a direction"
        raise InputError(Diagnostic(message, formula.span, "direction", hint))
    if formula.bound is not None and formula.bound.operator not in ("<=", ">="):
        message = "bounds of objectives in multi(...) must be <= or >="
        raise InputError(Diagnostic(message, formula.span, "multi"))
    query = query_of(context, formula)
    bound = None if query.threshold is None else query.threshold.value
    # Some strategy has to keep a bound: the best one to keep >= has the greatest value.
    maximises = (
        query.direction is Direction.MAX
        if query.threshold is None
        else query.threshold.operator.is_lower_bound
    )
    return Objective(pretty(formula), query.quantity, 1 if maximises else -1, bound)
