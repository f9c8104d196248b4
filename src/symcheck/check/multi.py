"""`multi(...)`: what an MDP's strategies achieve for several objectives at once, from the initial state.

With bounds only: whether some strategy meets all of them. With one objective asked for: its best value over the strategies
that meet the others (NaN where there are none). With two: the corners of their Pareto curve. Objectives are P with any
formula of linear time, and R with C and C<=k. See `symcheck.numerics.multi` for the method and its sources.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isinf, nan
from time import perf_counter

import numpy as np

from symcheck.check.context import Context
from symcheck.check.discrete import per_row
from symcheck.check.listed import listed
from symcheck.check.ltl import linear_product
from symcheck.check.paths import StatesOf, TemporalPath, temporal
from symcheck.check.result import Answer, Estimate, Exact, Result, Run
from symcheck.check.rewards import structure_number
from symcheck.check.window import window
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.product import Product
from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.numerics import multi as numerics
from symcheck.numerics.graph import Incidence
from symcheck.numerics.matrix import Bools, Floats, Int32s
from symcheck.semantics.evaluate import evaluate
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


@dataclass(frozen=True)
class _Objective:
    """One objective. sign: 1 where more is better, -1 where less is. bound: None where it is asked for."""

    formula: ProbabilityOperator | RewardOperator
    sign: int
    bound: float | None

    @property
    def probability(self) -> bool:
        return isinstance(self.formula, ProbabilityOperator)

    def internal(self, value: float) -> float:
        """A value so that more is better (its own inverse): a small probability is a great one of the negation."""
        if self.sign > 0:
            return value
        return 1.0 - value if self.probability else -value

    @property
    def least(self) -> float:
        """What is needed at least, so written."""
        return -inf if self.bound is None else self.internal(self.bound)

    def shown(self, value: float) -> float:
        """A value as the user reads it, and 0 without a sign."""
        value = self.internal(value)
        return (min(1.0, max(0.0, value)) if self.probability else value) + 0.0


@dataclass(frozen=True)
class _Steps:
    """An automaton without letters that counts the steps up to a number."""

    table: Int32s
    initial: int = 0


def check_multi(context: Context, formula: MultiObjective, states_of: Callable[[Context], StatesOf]) -> Result:
    """The answer of a multi-objective query. Raises InputError for wrong ones, UnsupportedError for other objectives.

    A linear program needs rows: with an engine on diagrams, the states are listed for it (and `-v` says so).
    """
    _supported(context, formula)
    own = listed(context)
    return _check(own, formula, states_of(own), "" if own is context else "; states listed, as a linear program needs rows")


def _check(context: Context, formula: MultiObjective, states_of: StatesOf, remark: str) -> Result:
    objectives = [_objective(o) for o in formula.objectives]
    asked = [i for i, o in enumerate(objectives) if o.bound is None]
    if len(asked) > 2:
        raise UnsupportedError("multi(...) with more than two objectives that are asked for is not supported; bound the others")
    started = perf_counter()
    flow = _flow(context, objectives, states_of)
    least = np.array([o.least for o in objectives])
    value, about = _Query(context, objectives, asked, flow, least).answer()
    if value is nan and _cost(objectives[asked[0]]):
        # Either the bounds cannot be met, or they can, but only at infinite cost.
        rest = [o for o in objectives if o.bound is not None]
        others = _flow(context, rest, states_of)
        met, _ = _Query(context, rest, (), others, np.array([o.least for o in rest])).answer()
        value, about = (inf, "every strategy that meets the bounds has infinite cost") if met else (value, about)
    note = f"linear program of {flow.gains.shape[1]} variables: {about}{remark}"
    context.notes.runs.append(Run("linear", "linear program", flow.gains.shape[1], 0, perf_counter() - started, note, certified=False))
    settled = isinstance(value, bool) or (isinstance(value, float) and not isfinite(value))
    return Result(value, Exact() if settled else Estimate(), about)


def _cost(objective: _Objective) -> bool:
    return objective.sign < 0 and not objective.probability


def _supported(context: Context, formula: MultiObjective) -> None:
    if context.engine.model.type is not ModelType.MDP:
        raise InputError(Diagnostic("multi(...) is about the strategies of an mdp", formula.span, "multi"))
    if context.engine.initial.count != 1:
        raise UnsupportedError("multi(...) on a model with several initial states is not supported; give it a single one")
    if context.options.fairness:
        raise UnsupportedError("multi(...) over fair strategies only is not supported; without -fair it is")
    if context.engine.exact:
        raise UnsupportedError("multi(...) in rational arithmetic is not supported; without -exact it is")


def _objective(formula: Expression) -> _Objective:
    if not isinstance(formula, ProbabilityOperator | RewardOperator):
        raise InputError(Diagnostic("an objective of multi(...) must be a P or an R operator", formula.span, "multi"))
    if isinstance(formula, RewardOperator) and not isinstance(formula.query, TotalReward | CumulativeReward):
        raise UnsupportedError("rewards in multi(...) are supported with C and C<=k only")
    match formula.bound:
        case None:
            if formula.direction not in ("min", "max"):
                hint = "write Pmin=?, Pmax=?, Rmin=? or Rmax=?"
                raise InputError(Diagnostic("an objective that is asked for needs a direction", formula.span, "direction", hint))
            return _Objective(formula, 1 if formula.direction == "max" else -1, None)
        case Bound(operator, threshold):
            if operator not in ("<=", ">="):
                raise InputError(Diagnostic("bounds of objectives in multi(...) must be <= or >=", formula.span, "multi"))
            return _Objective(formula, 1 if operator == ">=" else -1, float(evaluate(threshold, {})))


@dataclass(frozen=True)
class _Query:
    """The question, once the flow is known."""

    context: Context
    objectives: Sequence[_Objective]
    asked: Sequence[int]
    flow: numerics.Flow
    least: Floats

    def answer(self) -> tuple[Answer, str]:
        """The value, and how it was found."""
        flow = self.flow.connected(self.least)
        bounded = bool(np.isfinite(self.least).any())
        room = flow.margin(self.least) if bounded else None
        if bounded and (room is None or room.value < -numerics.TOLERANCE):
            return self._none(room)
        if room is not None and abs(room.value) <= numerics.TOLERANCE:
            self.context.notes.warn(
                "the bounds can be met just so, within the rounding of the linear program: on which side the truth lies is not proved"
            )
        margin = "" if room is None else f"the bounds can be exceeded by {max(0.0, room.value):.3g} at once"
        if not self.asked:
            return True, margin
        # Bounds that are met just so are relaxed by as little as rounding needs.
        least = self.least if room is None else np.minimum(self.least, self.least + room.value)
        return self._best(flow, least) if len(self.asked) == 1 else self._curve(flow, least)

    def _none(self, room: numerics.Outcome | None) -> tuple[Answer, str]:
        about = "no strategy meets the bounds" + ("" if room is None else f": {-room.value:.3g} is missing")
        if not self.asked:
            return False, about
        return nan, about

    def _best(self, flow: numerics.Flow, least: Floats) -> tuple[Answer, str]:
        (index,) = self.asked
        objective = self.objectives[index]
        weights = np.zeros(len(self.objectives))
        weights[index] = 1.0
        found = flow.best(weights, least)
        if found is None:
            return nan, "no strategy meets the bounds"
        if isinf(found.value):
            return inf, "rewards can be collected for ever"
        return objective.shown(found.value), f"the dual bound differs by {found.gap:.1E}"

    def _curve(self, flow: numerics.Flow, least: Floats) -> tuple[Answer, str]:
        first, second = self.asked
        points = numerics.corners(flow, first, second, least)
        if points is None:
            raise InputError(Diagnostic("no strategy meets the bounds of this Pareto query, or all have infinite cost", code="multi"))
        one, two = self.objectives[first], self.objectives[second]
        return [(one.shown(x), two.shown(y)) for x, y in points], "Pareto curve"


def _flow(context: Context, objectives: Sequence[_Objective], states_of: StatesOf) -> numerics.Flow:
    """The flow of the product of the model with a step counter and with an automaton per P objective."""
    chain = _Chain(context)
    limits = [_limit(o) for o in objectives]
    counted = max((k for k in limits if k is not None), default=None)
    counts: dict[int, StateSet] = {}
    if counted is not None:
        product: Product = chain.engine.product((), _counter(counted))
        counts = {k: product.automaton_states(frozenset(range(k))) for k in limits if k is not None}
        chain = chain.extended(product)
    before = chain
    accepted: list[list[list[StateSet]] | None] = []
    for o in objectives:
        if not isinstance(o.formula, ProbabilityOperator):
            accepted.append(None)
            continue
        path = temporal(o.formula.path, states_of)
        lifted = tuple((e, chain.lift(s)) for e, s in path.letters)
        path = TemporalPath(path.formula, lifted, negative=o.sign < 0)
        product, pairs = linear_product(replace(context, engine=chain.engine), path)
        accepted = [_lifted(product, a) for a in accepted]
        accepted.append([[avoid, *visits] for avoid, visits in pairs])
        chain = chain.extended(product)
    counts = {k: chain.lift(s, since=len(before.products)) for k, s in counts.items()}
    return _equations(chain, objectives, limits, counts, accepted)


def _equations(
    chain: _Chain,
    objectives: Sequence[_Objective],
    limits: Sequence[int | None],
    counts: dict[int, StateSet],
    accepted: Sequence[list[list[StateSet]] | None],
) -> numerics.Flow:
    engine = chain.engine
    system = engine.system(engine.all)
    matrix = system.matrix
    rewards = np.zeros((len(objectives), matrix.rows))
    costless = np.ones(matrix.rows, dtype=np.bool_)
    for i, o in enumerate(objectives):
        if isinstance(o.formula, RewardOperator):
            states, rows = system.rewards(structure_number(chain.context, o.formula))
            reward = np.asarray(per_row(system, states) + rows, dtype=np.float64)
            if (reward < 0).any():
                raise UnsupportedError("negative rewards in multi(...) are not supported")
            k = limits[i]
            if k is not None:
                reward = np.where(per_row(system, engine.to_bools(counts[k]).astype(np.float64)) > 0, reward, 0.0)
            rewards[i] = o.sign * reward
            if o.sign < 0:
                costless &= reward == 0

    def bools(pairs: list[list[StateSet]]) -> list[tuple[Bools, list[Bools]]]:
        return [(engine.to_bools(avoid), [engine.to_bools(v) for v in visits]) for avoid, *visits in pairs]

    stays = numerics.settling(Incidence(matrix), costless, [None if a is None else bools(a) for a in accepted])
    initial = int(np.flatnonzero(engine.to_bools(engine.initial))[0])
    return numerics.Flow(matrix, initial, rewards, stays)


def _lifted(product: Product, pairs: list[list[StateSet]] | None) -> list[list[StateSet]] | None:
    return None if pairs is None else [[product.lift(s) for s in sets] for sets in pairs]


def _limit(objective: _Objective) -> int | None:
    """The number of steps of C<=k."""
    query = objective.formula.query if isinstance(objective.formula, RewardOperator) else None
    if not isinstance(query, CumulativeReward):
        return None
    steps = window(query.bound).steps()
    if steps.upper is None or steps.lower:
        raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
    return steps.upper


def _counter(limit: int) -> _Steps:
    return _Steps(np.minimum(np.arange(1, limit + 2), limit).astype(np.int32)[:, None])


@dataclass(frozen=True)
class _Chain:
    """Products, one on top of the other."""

    context: Context
    products: tuple[Product, ...] = ()

    @property
    def engine(self) -> Engine:
        return self.products[-1].engine if self.products else self.context.engine

    def extended(self, product: Product) -> _Chain:
        return _Chain(self.context, (*self.products, product))

    def lift(self, states: StateSet, since: int = 0) -> StateSet:
        """A set of an engine `since` products up, in the last one."""
        for product in self.products[since:]:
            states = product.lift(states)
        return states
