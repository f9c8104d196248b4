"""Writing certificates: vectors that prove bounds of a value to a checker of its own.

The inequalities are those of `symcheck_verify`, which imports nothing of symcheck.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from symcheck.check.certificate import Certificate
from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.check.measures.reachability import until
from symcheck.check.queries.values import values
from symcheck.check.state_formulas import query_of, satisfying
from symcheck.check.strategies.strategy import strategy_of
from symcheck.check.strategies.to_explicit import rows_engine
from symcheck.direction import Direction
from symcheck.engines.base import Number, StateSet, System
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.transition_actions import state_order
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.numbers import Rationals, doubles, full, rationals
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, per_row
from symcheck.numerics import graph
from symcheck.numerics.inductive_bounds import (
    InductiveVector,
    Inequalities,
    RationalRows,
    average_vectors,
    inductive,
)
from symcheck.semantics import query as asked
from symcheck.semantics.features import Feature, require
from symcheck.semantics.path_formulas import NextPath, PathFormula, UntilPath
from symcheck.semantics.query import Query
from symcheck.semantics.query import query_of as resolve
from symcheck.semantics.rewards import Reward, Structure, Time
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    Expression,
    Filter,
    LabelReference,
    Literal,
    Unary,
    letters_of,
)
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.printer import pretty

__all__ = ["certify"]

_STEP_ERROR = Fraction(1, 2**90)
"""More than what a checker's step of bounded measures adds to the width of bounds."""
_STATED = Fraction(1, 10**11)
"""Relative width that is stated of values within steps or a time; the checker computes them."""

_PART_OF_EPSILON = 1e-4
"""Accuracy of the values from which vectors are made: slack makes their bounds wider."""

Json = dict[str, Any]


def certify(context: Context, formula: Expression) -> Certificate:
    """A certificate of the value of a measure in the initial states.

    Args:
        context: the model, and the accuracy of the values.
        formula: a P, R, T or S formula, or its least or greatest value in the initial states.

    Raises:
        UnsupportedError: there are no certificates for such a formula, or the model cannot be
            explored in rational arithmetic.
        NumericalError: no vectors were found that satisfy the inequalities, or the bounds do not
            decide the comparison of the formula.
    """
    require(context.engine.model, Feature.CERTIFICATES)
    match formula:
        case Filter("min" | "max", inner, LabelReference("init")):
            formula = inner  # bounds in each initial state say what the least and greatest are
        case _:
            pass
    if not isinstance(formula, AnyMeasure):
        raise UnsupportedError(f"certificates are for {letters_of(AnyMeasure)} formulas")
    if context.options.fairness:
        raise UnsupportedError("certificates are not supported with -fair")
    context = replace(context, relevant_states=None)
    context = context.with_epsilon(context.options.epsilon * _PART_OF_EPSILON)
    exact = context if context.engine.is_rational else exact_twin(context)
    return _Writer(context, exact, rows_engine(exact), formula).certificate()


@dataclass(frozen=True, eq=False)
class _Writer:
    """A measure of a model, its values, and the parts of its certificate.

    context: the model in which the values are computed. exact, model: the same one in rationals.
    """

    context: Context
    exact: Context
    model: ExplicitEngine
    formula: AnyMeasure

    def certificate(self) -> Certificate:
        """The statement and its evidence."""
        text, query = resolve(self.formula, self.model.model), query_of(self.exact, self.formula)
        statement, evidence = self._proof(text, query)
        direction = query.direction
        if statement.get("negated"):
            direction = direction and direction.dual
        statement["optimum"] = None if direction is None else direction.value
        bounds = self._stated(statement, evidence)
        statement["bounds"] = {str(s): list(map(_number, ends)) for s, ends in bounds.items()}
        if (threshold := query.threshold) is not None:
            verdicts = [{threshold.admits(e) for e in ends} for ends in bounds.values()]
            if any(len(of_ends) > 1 for of_ends in verdicts):
                raise NumericalError(
                    "a value is so near to the threshold that the bounds of a certificate do not "
                    "decide the comparison"
                )
            held = set[bool]().union(*verdicts)
            statement["comparison"] = {
                "operator": threshold.operator.value,
                "threshold": str(threshold.value),
                "holds": held == {True},
            }
        return Certificate(self.exact.engine, pretty(self.formula), statement, evidence)

    def _proof(self, text: Query[Expression], query: Query[StateSet]) -> tuple[Json, Json]:
        """The statement, without bounds, and the evidence of both sides."""
        match text.quantity, query.quantity:
            case asked.PathProbability(path), asked.PathProbability(over):
                return self._path(path, over, query.direction)
            case asked.ReachReward(reward, target), asked.ReachReward(_, over):
                evidence = self._reach_reward(reward, self.model_set(over), query.direction)
                return self._of(reward, "reward", target=self._set(target)), evidence
            case asked.CumulativeReward(reward, window), _ if not self._continuous:
                return self._of(reward, "cumulative", steps=_steps(window)), {}
            case asked.InstantaneousReward(reward, time), _ if not self._continuous:
                return self._of(reward, "instantaneous", steps=int(time)), {}
            case asked.LongRunReward(reward), _:
                rewards = self._system.step_rewards(reward)
                return self._of(reward, "average"), self._average(rewards, query.direction)
            case asked.LongRunProbability(states), asked.LongRunProbability(over):
                inside = per_row(self.model.matrix.groups, rationals(self.model_set(over).tolist()))
                evidence = self._average(inside * self._stay, query.direction)
                return {"measure": "average", "states": self._set(states)}, evidence
            case _:
                raise _unsupported()

    @cached_property
    def _order(self) -> Int64s:
        """The state of the model with each number of the exported files."""
        order = state_order(self.exact.engine)
        return np.arange(self.model.states) if order is None else order

    @property
    def _continuous(self) -> bool:
        return self.model.model.type.continuous_time

    @cached_property
    def _system(self) -> System:
        """The transitions among all states, in rationals."""
        return self.exact.engine.system(self.exact.engine.all)

    def model_set(self, states: StateSet) -> Bools:
        """A set of states, bool[n]."""
        return self.exact.engine.to_bools(states)

    @property
    def _matrix(self) -> SparseMatrix:
        """The probabilities of all rows."""
        return self.model.matrix

    @cached_property
    def _rows(self) -> RationalRows:
        """The rows, which all inequalities share."""
        return RationalRows(self._matrix)

    @cached_property
    def _stay(self) -> Rationals:
        """The mean time of a step of each row."""
        exit_rates = self._system.exit_rates
        if exit_rates is None:
            return full(self._matrix.rows, 1, rational=True)
        return rationals((1 / exit_rates).tolist())

    def _of(self, reward: Reward, measure: str, **about: object) -> Json:
        """The statement of an expected reward."""
        match reward:
            case Structure(index):
                structures = self.model.model.rewards
                name: str | None = structures[index].name or ""
                if sum((r.name or "") == name for r in structures) > 1:
                    raise UnsupportedError(
                        "a certificate names its reward structure: give each of them a name"
                    )
            case Time():
                name = None
            case _:
                raise _unsupported()
        return {"measure": measure, "reward": name, **about}

    def _values(self) -> Floats:
        """The values in all states, from the middle of their bounds."""
        query = query_of(self.context, self.formula)
        low, high = values(self.context, query).at(self.context.engine.all)
        low, high = doubles(low), doubles(high)
        with np.errstate(invalid="ignore"):  # both are infinite
            return np.where(low == high, low, low + (high - low) / 2)

    def _path(
        self,
        path: PathFormula[Expression],
        over: PathFormula[StateSet],
        direction: Direction | None,
    ) -> tuple[Json, Json]:
        """The statement and the evidence of the probability of a path formula."""
        match path, over:
            case UntilPath(left, right, window, negative), UntilPath(passing, goal):
                statement: Json = {
                    "measure": "until",
                    "left": self._set(left),
                    "right": self._set(right),
                    "negated": negative,
                }
                if window.is_unbounded:
                    guess, towards = self._values(), direction
                    if negative:
                        guess, towards = 1 - guess, direction and direction.dual
                    sets = self.model_set(passing), self.model_set(goal)
                    return statement, {
                        name: self._until(*sets, towards, guess, upper=upper)
                        for name, upper in _SIDES
                    }
                if not window.contains_zero:
                    raise _unsupported()
                if self._continuous:
                    return {**statement, "time": str(window.upper)}, {}
                return {**statement, "steps": _steps(window)}, {}
            case NextPath(target, window, negative), _ if (
                window.is_unbounded and not self._continuous
            ):
                inside = {"not": self._set(target)} if negative else self._set(target)
                return {"measure": "instantaneous", "states": inside, "steps": 1}, {}
            case _:
                raise _unsupported()

    def _until(
        self,
        left: Bools,
        right: Bools,
        direction: Direction | None,
        guess: Floats,
        *,
        upper: bool,
    ) -> Json:
        free, certain = left & ~right, np.zeros_like(right)
        if not upper:  # a probability of 1 is proved without slack
            certain = graph.prob1(self._matrix, left, right, direction) & free
        problem = Inequalities(
            self._rows,
            free=free & ~certain,
            fixed=(right | certain).astype(np.float64),
            earned=None,
            upper=upper,
            all_rows=_all_rows(direction, upper=upper),
            ends=None if upper else right,
            certain=certain,
            limit=1.0,
        )
        return self._side(inductive(problem, guess))

    def _reach_reward(self, reward: Reward, target: Bools, direction: Direction | None) -> Json:
        everywhere = np.ones_like(target)
        dual = direction and direction.dual
        certain = graph.prob1(self._matrix, everywhere, target, dual)
        guess = self._values()
        if not np.isfinite(guess[certain]).all():
            raise _unsupported()
        earned = self._system.step_rewards(reward)
        if (earned[per_row(self.model.matrix.groups, certain & ~target)] < 0).any():
            raise UnsupportedError(
                "certificates of rewards until states are reached are not supported with negative "
                "rewards"
            )
        evidence = {}
        for name, upper in _SIDES:
            problem = Inequalities(
                self._rows,
                free=certain & ~target,
                fixed=np.where(certain, 0.0, np.inf),
                earned=earned,
                upper=upper,
                all_rows=_all_rows(direction, upper=upper),
                ends=target if upper else None,
            )
            evidence[name] = self._side(inductive(problem, guess))
        if not certain.all():
            engine = self.context.engine
            within = until(self.context, engine.all, engine.from_bools(target), dual)
            missed = doubles(within.at(engine.all)[1])
            evidence["lower"]["missed"] = self._until(everywhere, target, dual, missed, upper=True)
        return evidence

    def _average(self, earned: Rationals, direction: Direction | None) -> Json:
        gain, strategy = self._values(), None
        if direction is not None:
            strategy = strategy_of(self.exact, self.formula).rows
        evidence: Json = {}
        for name, upper in _SIDES:
            problem = Inequalities(
                self._rows,
                free=np.ones(self._matrix.states, np.bool_),
                fixed=np.zeros(self._matrix.states),
                earned=earned,
                upper=upper,
                all_rows=_all_rows(direction, upper=upper),
                ends=None,
                strategy=strategy,
            )
            found = average_vectors(problem, self._stay, gain)
            sides = {"gain": self._vector(found.gain), "bias": self._vector(found.bias)}
            evidence[name] = {**sides, **self._choices(found.gain.choices)}
        return evidence

    def _side(self, found: InductiveVector) -> Json:
        """The vector, the choices and the ranks of one side."""
        side: Json = {"vector": self._vector(found), **self._choices(found.choices)}
        if found.ranks is not None:
            ranks = found.ranks[self._order].tolist()
            side["ranks"] = [None if rank < 0 else rank for rank in ranks]
        return side

    def _vector(self, found: InductiveVector) -> Json:
        numerators = found.numerators[self._order].tolist()
        return {"denominator": str(1 << found.bits), "numerators": numerators}

    def _choices(self, rows: Int64s | None) -> Json:
        groups = self._matrix.groups
        if rows is None or groups is None:
            return {}
        return {"choices": (rows - groups[:-1])[self._order].tolist()}

    def _stated(self, statement: Json, evidence: Json) -> dict[int, tuple[Number, Number]]:
        """The bounds of each initial state: those of the vectors, or of the values in steps."""
        initial = np.flatnonzero(self.model_set(self.exact.engine.initial)[self._order]).tolist()
        if evidence:
            sides = [_bound_of(evidence[name], initial) for name, _ in _SIDES]
            if statement.get("negated"):
                sides = [[1 - v for v in side] for side in reversed(sides)]
            return dict(zip(initial, zip(*sides, strict=True), strict=True))
        engine = self.context.engine
        query = query_of(self.context, self.formula)
        found = values(self.context.relevant_at(engine.initial), query).at(engine.all)
        low, high = (rationals(side[self._order][initial].tolist()) for side in found)
        room = (int(statement.get("steps", 0)) + 1000) * _STEP_ERROR
        stated = {}
        for state, below, above in zip(initial, low, high, strict=True):
            ends = below - abs(below) * _STATED - room, above + abs(above) * _STATED + room
            if statement["measure"] == "until":
                ends = max(ends[0], Fraction(0)), min(ends[1], Fraction(1))
            stated[state] = ends
        return stated

    def _set(self, formula: Expression) -> object:
        """A set of states by labels of the model, where its formula has no other names."""
        match formula:
            case Literal(value=True):
                return "all"
            case LabelReference(name=name) if name in (
                *self.model.model.labels,
                "init",
                "deadlock",
            ):
                return {"label": name}
            case Unary(UnaryOperator.NOT, operand):
                return {"not": self._set(operand)}
            case Binary(Operator.OR, left, right):
                return {"or": [self._set(left), self._set(right)]}
            case Binary(Operator.AND, left, right):
                parts = [{"not": self._set(left)}, {"not": self._set(right)}]
                return {"not": {"or": parts}}
            case _:
                members = satisfying(self.exact, formula, self.exact.engine.all)
                return {"states": np.flatnonzero(self.model_set(members)[self._order]).tolist()}


_SIDES = (("lower", False), ("upper", True))


def _all_rows(direction: Direction | None, *, upper: bool) -> bool:
    """Whether a bound has to hold for all strategies; for the others, one suffices."""
    return direction is None or (direction is Direction.MAX) is upper


def _bound_of(side: Json, states: Sequence[int]) -> list[Number]:
    vector = side.get("gain") or side["vector"]
    denominator = int(vector["denominator"])
    numerators = [vector["numerators"][state] for state in states]
    return [inf if v is None else Fraction(v, denominator) for v in numerators]


def _number(value: Number) -> str:
    return "Infinity" if isinstance(value, float) else str(value)


def _steps(window: Window) -> int:
    steps = window.steps().upper
    assert steps is not None
    return steps


def _unsupported() -> UnsupportedError:
    return UnsupportedError(
        "certificates are for probabilities of X, and of F, G, U, W and R with at most an upper "
        "bound on steps or time, for rewards until states are reached, of the first steps or after "
        "some, and for long-run averages"
    )
