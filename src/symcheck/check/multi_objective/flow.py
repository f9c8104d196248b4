"""The flow of a multi-objective query, on the product with a step counter and automata."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.omega_regular.ltl import linear_product
from symcheck.check.path_formulas import StatesOf, TemporalPath, UntilPath, resolve, temporal
from symcheck.check.queries.rewards import reward_of
from symcheck.engines.base import Engine, Number, Product, StateSet
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite
from symcheck.matrices.rows import Bools, Int32s
from symcheck.numerics.graph import Incidence
from symcheck.numerics.multi_objective import linear_program as numerics
from symcheck.semantics.rewards import Reward, Steps, Time
from symcheck.semantics.time_bounds import window
from symcheck.syntax.ast import (
    BinaryTemporal,
    CostBoundedReward,
    CumulativeReward,
    DiscountedReward,
    Eventually,
    ExpectedTime,
    ExpressionNode,
    InstantaneousReward,
    PathFormula,
    ProbabilityOperator,
    RewardOperator,
    SteadyState,
    SteadyStateReward,
    TotalReward,
    UnaryTemporal,
)

__all__ = ["Objective", "ProductFlow", "flow_of"]


ObjectiveFormula = ProbabilityOperator | RewardOperator | ExpectedTime | SteadyState


@dataclass(frozen=True)
class Objective:
    """One objective. sign: 1 to maximise, -1 to minimise. bound: None if there is none."""

    formula: ObjectiveFormula
    sign: int
    bound: Fraction | None

    @property
    def probability(self) -> bool:
        """Whether it is a P operator."""
        return isinstance(self.formula, ProbabilityOperator)

    @property
    def long_run(self) -> bool:
        """Whether it is a long-run average."""
        formula = self.formula
        return isinstance(formula, SteadyState) or (
            isinstance(formula, RewardOperator) and isinstance(formula.query, SteadyStateReward)
        )

    def internal(self, value: Number) -> Number:
        """A value for maximisation: a probability becomes that of the negation. Its own inverse."""
        if self.sign > 0:
            return value
        return 1 - value if self.probability else -value

    @property
    def least(self) -> Fraction | float:
        """The lower bound for maximisation; -inf without bound."""
        return -inf if self.bound is None else self.internal(self.bound)

    def shown(self, value: Number) -> Number:
        """A value as it is reported; never -0."""
        value = self.internal(value)
        return (min(max(value, 0), 1) if self.formula.is_probability else value) + 0


@dataclass(frozen=True)
class _TableAutomaton:
    """An automaton, by its table."""

    table: Int32s
    initial: int = 0


_SEEN = _TableAutomaton(np.array([[0, 1], [1, 1]], dtype=np.int32))
"""Whether a state with the only letter has been left."""


@dataclass(frozen=True)
class _Terms:
    """What an objective is about, on the last product.

    Attributes:
        reward: earned in each step; None for a P operator.
        earning: the states in which the reward is earned.
        accepted: of a P operator, its pairs [avoid, *visits].
    """

    reward: Reward | None = None
    earning: StateSet | None = None
    accepted: list[list[StateSet]] | None = None

    def lifted(self, product: Product) -> _Terms:
        """The same on the product of the last product and an automaton."""
        return replace(
            self,
            earning=None if self.earning is None else product.lift(self.earning),
            accepted=None
            if self.accepted is None
            else [[product.lift(s) for s in sets] for sets in self.accepted],
        )


@dataclass(frozen=True, eq=False)
class ProductFlow:
    """The equations of the flow through a product, which is the engine."""

    flow: numerics.Flow
    engine: Engine


def flow_of(context: Context, objectives: Sequence[Objective], states_of: StatesOf) -> ProductFlow:
    """The flow of the product with all that objectives must remember.

    That is a step counter for C<=k, whether F has been reached, and the automaton of P.
    """
    products = _Products(context)
    limits = [_limit(o) for o in objectives]
    counted = max((k for k in limits if k is not None), default=None)
    counter: Product | None = None
    if counted is not None:
        counter = products.engine.product((), _counter(counted))
        products = products.extended(counter)
    terms: list[_Terms] = []
    for o, limit in zip(objectives, limits, strict=True):
        product, parts = _terms(products, o, states_of)
        if limit is not None and counter is not None:
            within = counter.automaton_states(frozenset(range(limit)))
            parts = replace(parts, earning=products.lift(within, since=1))
        if product is not None:
            terms = [t.lifted(product) for t in terms]
            products = products.extended(product)
        terms.append(parts)
    return _equations(products, objectives, terms)


def _terms(
    products: _Products, objective: Objective, states_of: StatesOf
) -> tuple[Product | None, _Terms]:
    """What an objective is about, and the product that it needs."""
    context, formula, engine = products.context, objective.formula, products.engine
    match formula:
        case ProbabilityOperator(path=path):
            read = temporal(path, states_of, context.engine.model)
            lifted = tuple((e, products.lift(s)) for e, s in read.sets)
            read = TemporalPath(read.form, lifted, negative=objective.sign < 0)
            inner = replace(context, engine=engine).without_strategy()
            product, pairs = linear_product(inner, read)
            return product, _Terms(accepted=[[avoid, *visits] for avoid, visits in pairs])
        case SteadyState(formula=inner):
            return None, _Terms(Steps(), products.lift(states_of(inner)))
        case ExpectedTime(path=path):
            return _until(products, Time(), path, states_of)
        case RewardOperator(query=query):
            reward = reward_of(context, formula)
            match query:
                case TotalReward() | CumulativeReward() | SteadyStateReward():
                    return None, _Terms(reward, engine.all)
                case InstantaneousReward() | DiscountedReward() | CostBoundedReward():
                    raise _unsupported()
                case ExpressionNode() | UnaryTemporal() | BinaryTemporal():
                    return _until(products, reward, query, states_of)
                case _:
                    assert_never(query)
        case _:
            assert_never(formula)


def _unsupported() -> UnsupportedError:
    return UnsupportedError(
        "objectives of multi(...) with R are supported with C, C<=k, S and F states, those with T "
        "with F states"
    )


def _until(
    products: _Products, reward: Reward, path: PathFormula, states_of: StatesOf
) -> tuple[Product | None, _Terms]:
    """The reward that is earned until states are reached, or for ever if they are not."""
    context, engine = products.context, products.engine
    read = resolve(path, states_of, context.engine) if isinstance(path, Eventually) else None
    if not isinstance(read, UntilPath) or not read.window.trivial:
        raise _unsupported()
    target = products.lift(read.right)
    if target <= engine.graph.all_successors_in(target):
        return None, _Terms(reward, ~target)
    product: Product = engine.product((target,), _SEEN)
    before = product.automaton_states(frozenset({0})) - product.lift(target)
    return product, _Terms(reward, before)


def _equations(
    products: _Products, objectives: Sequence[Objective], terms: Sequence[_Terms]
) -> ProductFlow:
    engine = products.engine
    matrix = engine.system(engine.all).matrix
    assert matrix.groups is not None
    rewards: list[Numbers] = []
    costless = np.ones(matrix.rows, dtype=np.bool_)
    for o, t in zip(objectives, terms, strict=True):
        earned = full(matrix.rows, 0, exact=engine.exact)
        if t.reward is not None and t.earning is not None:
            earning = matrix.rows_of(engine.to_bools(t.earning))
            earned = np.where(earning, engine.system(engine.all).step_rewards(t.reward), earned)
            if is_infinite(earned).any():
                raise UnsupportedError("infinite rewards in multi(...) are not supported")
            if not o.long_run and (earned < 0).any():
                raise UnsupportedError(
                    "negative rewards in multi(...) are supported for long-run averages only"
                )
            if o.sign < 0 and not o.long_run:
                costless &= np.asarray(earned == 0, dtype=np.bool_)
        rewards.append(o.sign * earned)

    def bools(pairs: list[list[StateSet]]) -> list[tuple[Bools, list[Bools]]]:
        return [
            (engine.to_bools(avoid), [engine.to_bools(v) for v in visits])
            for avoid, *visits in pairs
        ]

    long_run = np.array([o.long_run for o in objectives])
    stays = numerics.settling(
        Incidence(matrix),
        costless,
        [None if t.accepted is None else bools(t.accepted) for t in terms],
        averages=bool(long_run.any()),
    )
    initial = int(np.flatnonzero(engine.to_bools(engine.initial))[0])
    kind = object if engine.exact else np.float64
    of_objectives = np.array(rewards, dtype=kind).reshape(-1, matrix.rows)
    none = np.zeros_like(of_objectives) if not engine.exact else 0 * of_objectives
    flow = numerics.Flow(
        matrix,
        initial,
        np.where(long_run[:, None], none, of_objectives),
        np.where(long_run[:, None], of_objectives, none),
        stays,
        costless,
    )
    return ProductFlow(flow, engine)


def _limit(objective: Objective) -> int | None:
    """The number of steps of C<=k."""
    query = objective.formula.query if isinstance(objective.formula, RewardOperator) else None
    if not isinstance(query, CumulativeReward):
        return None
    steps = window(query.bound).steps()
    if steps.upper is None or steps.lower:
        raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
    return steps.upper


def _counter(limit: int) -> _TableAutomaton:
    return _TableAutomaton(np.minimum(np.arange(1, limit + 2), limit).astype(np.int32)[:, None])


@dataclass(frozen=True)
class _Products:
    """A sequence of products, each of the previous one."""

    context: Context
    products: tuple[Product, ...] = ()

    @property
    def engine(self) -> Engine:
        return self.products[-1].engine if self.products else self.context.engine

    def extended(self, product: Product) -> _Products:
        return _Products(self.context, (*self.products, product))

    def lift(self, states: StateSet, since: int = 0) -> StateSet:
        """A set of the engine after `since` products, lifted to the last product."""
        for product in self.products[since:]:
            states = product.lift(states)
        return states
