"""`multi(...)`: what an MDP's strategies achieve for several objectives at once, from the initial state.

With bounds only: whether some strategy meets all of them. With one objective asked for: its best value over the strategies
that meet the others (NaN where there are none). With two: the corners of their Pareto curve. Objectives are P with any
formula of linear time, and R with C and C<=k. See `symcheck.numerics.multi_objective.linear_program` for the method and its sources.

Linear programs are solved in floating point first. Where they are small, their corner is proved in rational arithmetic, on
the model explored exactly; where they are not, numbers are estimates, and a verdict that hangs on rounding is an error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, isfinite, isinf, nan
from time import perf_counter
from typing import Any

import numpy as np

from symcheck.check.context import Context
from symcheck.check.multi_objective.flow import Objective, flow_of
from symcheck.check.path_formulas import StatesOf
from symcheck.check.result import Answer, Estimate, Exact, Result, SolverRun
from symcheck.check.strategies.to_explicit import listed
from symcheck.errors import Diagnostic, InputError, NumericalError, UnsupportedError
from symcheck.matrices.numbers import full, is_infinite, numbers
from symcheck.numerics.multi_objective import linear_program as numerics
from symcheck.numerics.multi_objective.exact_lp import ROWS
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.syntax.ast import (
    Bound,
    CumulativeReward,
    Expression,
    ModelType,
    MultiObjective,
    ProbabilityOperator,
    RewardOperator,
    TotalReward,
)

__all__ = ["check_multi"]

PROVED = 300
"""Equations up to which results are proved in rational arithmetic without being asked to."""
_STATES = 20_000
_DOUBT = 100 * numerics.TOLERANCE
"""A verdict is believed where the linear program's margin is further from 0."""

Pick = Callable[[Context], StatesOf]


@dataclass(frozen=True)
class _Asked:
    """The answer, what to say about it, and whether it is proved (`close`: it hangs on the rounding of the linear program)."""

    value: Answer
    about: str
    variables: int
    equations: int
    proved: bool = False
    close: bool = False


def check_multi(context: Context, formula: MultiObjective, states_of: Pick) -> Result:
    """The answer of a multi-objective query. Raises InputError for wrong ones, UnsupportedError for other objectives.

    A linear program needs rows: with an engine on diagrams, the states are listed for it (and `-v` says so). Raises
    NumericalError where a verdict is not decided.
    """
    _supported(context, formula)
    started = perf_counter()
    if context.engine.exact:
        return _result(context, _solve(context, formula, states_of(context)), started)
    own = listed(context)
    found = _solve(own, formula, states_of(own))
    if found.equations <= (ROWS if found.close else PROVED) and own.engine.states <= _STATES:
        try:
            found = _by_rationals(own, formula, states_of)
        except (NumericalError, UnsupportedError) as error:
            if found.close:
                raise _undecided(error) from error
    elif found.close:
        raise _undecided(None)
    remark = "" if own is context else "; states listed, as a linear program needs rows"
    return _result(context, replace(found, about=found.about + remark), started)


def _by_rationals(context: Context, formula: MultiObjective, states_of: Pick) -> _Asked:
    """The same on the model explored exactly; numbers as doubles."""
    from symcheck.check.rebind_exact import exact_twin

    exact, twin = exact_twin(context, formula)
    assert isinstance(twin, MultiObjective)
    found = _solve(exact, twin, states_of(exact))
    return replace(found, value=_doubles(found.value))


def _doubles(value: Any) -> Any:
    if isinstance(value, list):
        return [(float(x), float(y)) for x, y in value]
    return float(value) if isinstance(value, Fraction) else value


def _undecided(error: Exception | None) -> NumericalError:
    reason = (
        "the linear program is too large for rational arithmetic" if error is None else str(error)
    )
    return NumericalError(
        f"the bounds can be met just so, within the rounding of the linear program: not decided ({reason})"
    )


def _result(context: Context, found: _Asked, started: float) -> Result:
    note = f"linear program of {found.variables} variables{', proved in rational arithmetic' if found.proved else ''}: {found.about}"
    context.log.runs.append(
        SolverRun(
            "linear",
            "linear program",
            found.variables,
            0,
            perf_counter() - started,
            note,
            certified=found.proved,
        )
    )
    if not found.proved:
        return Result(found.value, Estimate(), found.about)
    whole = isinstance(found.value, bool) or (
        isinstance(found.value, float) and not isfinite(found.value)
    )
    return Result(found.value, Exact(rounding=not whole and not context.engine.exact), found.about)


def _solve(context: Context, formula: MultiObjective, states_of: StatesOf) -> _Asked:
    objectives = [_objective(o) for o in formula.objectives]
    asked = [i for i, o in enumerate(objectives) if o.bound is None]
    if len(asked) > 2:
        raise UnsupportedError(
            "multi(...) with more than two objectives that are asked for is not supported; bound the others"
        )
    query = _query(context, objectives, asked, states_of)
    value, about = query.answer()
    close = query.close
    if value is nan and _cost(objectives[asked[0]]):
        # Either the bounds cannot be met, or they can, but only at infinite cost.
        others = _query(context, [o for o in objectives if o.bound is not None], (), states_of)
        met, _ = others.answer()
        close = others.close
        value, about = (
            (inf, "every strategy that meets the bounds has infinite cost")
            if met
            else (value, about)
        )
    flow = query.flow
    size, equations = flow.gains.shape[1], int(flow.live.sum()) + len(objectives)
    return _Asked(value, about, size, equations, flow.exact, close)


def _query(
    context: Context, objectives: Sequence[Objective], asked: Sequence[int], states_of: StatesOf
) -> _Query:
    flow = flow_of(context, objectives, states_of)
    least = numbers(np.array([o.least for o in objectives], dtype=object), exact=flow.exact)
    return _Query(objectives, asked, flow, least)


def _cost(objective: Objective) -> bool:
    return objective.sign < 0 and not objective.probability


def _supported(context: Context, formula: MultiObjective) -> None:
    if context.engine.model.type is not ModelType.MDP:
        raise InputError(
            Diagnostic("multi(...) is about the strategies of an mdp", formula.span, "multi")
        )
    if context.engine.initial.count != 1:
        raise UnsupportedError(
            "multi(...) on a model with several initial states is not supported; give it a single one"
        )
    if context.options.fairness:
        raise UnsupportedError(
            "multi(...) over fair strategies only is not supported; without -fair it is"
        )


def _objective(formula: Expression) -> Objective:
    if not isinstance(formula, ProbabilityOperator | RewardOperator):
        raise InputError(
            Diagnostic(
                "an objective of multi(...) must be a P or an R operator", formula.span, "multi"
            )
        )
    if isinstance(formula, RewardOperator) and not isinstance(
        formula.query, TotalReward | CumulativeReward
    ):
        raise UnsupportedError("rewards in multi(...) are supported with C and C<=k only")
    match formula.bound:
        case None:
            if formula.direction not in ("min", "max"):
                hint = "write Pmin=?, Pmax=?, Rmin=? or Rmax=?"
                raise InputError(
                    Diagnostic(
                        "an objective that is asked for needs a direction",
                        formula.span,
                        "direction",
                        hint,
                    )
                )
            return Objective(formula, 1 if formula.direction == "max" else -1, None)
        case Bound(operator, threshold):
            if operator not in ("<=", ">="):
                raise InputError(
                    Diagnostic(
                        "bounds of objectives in multi(...) must be <= or >=", formula.span, "multi"
                    )
                )
            return Objective(
                formula,
                1 if operator == ">=" else -1,
                Fraction(evaluate(threshold, {}, exact=True)),
            )


def _plain(value: Any) -> Any:
    """A number without the types of numpy."""
    return value if isinstance(value, Fraction) else float(value)


_NONE = "no strategy meets the bounds"
_NO_CURVE = "no strategy meets the bounds of this Pareto query, or all have infinite cost"


@dataclass
class _Query:
    """The question, once the flow is known. close: the answer hangs on rounding (never where numbers are rationals)."""

    objectives: Sequence[Objective]
    asked: Sequence[int]
    flow: numerics.Flow
    least: Any
    close: bool = False

    def answer(self) -> tuple[Answer, str]:
        """The value, and how it was found."""
        flow = self.flow.connected(self.least)
        room = None if is_infinite(self.least).all() else flow.margin(self.least)
        if not is_infinite(self.least).all():
            if room is None:
                self.close = not flow.exact  # nothing tells how far from it
                return (nan if self.asked else False), _NONE
            self.close = not flow.exact and abs(room.value) <= _DOUBT
            if room.value < -flow.tolerance:
                missing = f"{_NONE}: {float(-room.value):.3g} is missing"
                return (nan if self.asked else False), missing
        if not self.asked:
            return (
                True,
                ""
                if room is None
                else f"the bounds can be exceeded by {float(max(0, room.value)):.3g} at once",
            )
        # Bounds that are met just so are relaxed by as little as rounding needs.
        least = self.least if room is None else np.minimum(self.least, self.least + room.value)
        return self._best(flow, least) if len(self.asked) == 1 else self._curve(flow, least)

    def _best(self, flow: numerics.Flow, least: Any) -> tuple[Answer, str]:
        (index,) = self.asked
        weights = full(len(self.objectives), 0, exact=flow.exact)
        weights[index] = full(1, 1, exact=flow.exact)[0]
        found = flow.best(weights, least)
        if found is None:
            return nan, _NONE
        if isinf(found.value):
            return inf, "rewards can be collected for ever"
        optimal = "optimal vertex of the achievable set"
        about = optimal if flow.exact else f"the dual bound differs by {found.gap:.1E}"
        return _plain(self.objectives[index].shown(found.value)), about

    def _curve(self, flow: numerics.Flow, least: Any) -> tuple[Answer, str]:
        first, second = self.asked
        points = numerics.corners(flow, first, second, least)
        if points is None:
            raise InputError(Diagnostic(_NO_CURVE, code="multi"))
        one, two = self.objectives[first], self.objectives[second]
        return [(_plain(one.shown(x)), _plain(two.shown(y))) for x, y in points], "Pareto curve"
