"""The flow of a multi-objective query, on the product with a step counter and automata."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

import numpy as np

from symcheck.check.context import Context
from symcheck.check.omega_regular.ltl import linear_product
from symcheck.engines.base import Engine, Number, Product, StateSet
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite
from symcheck.matrices.rows import Bools, Int32s
from symcheck.numerics.graph import Incidence
from symcheck.numerics.multi_objective import linear_program as numerics
from symcheck.semantics.path_formulas import as_ltl
from symcheck.semantics.query import (
    CumulativeReward,
    LongRunProbability,
    LongRunReward,
    PathProbability,
    Quantity,
    ReachReward,
    TotalReward,
)
from symcheck.semantics.rewards import Reward, Steps

__all__ = ["Objective", "ProductFlow", "flow_of"]


@dataclass(frozen=True)
class Objective:
    """One objective.

    text: how it is written. quantity: what it is about, over the sets of the engine. sign: 1 to
    maximise, -1 to minimise. bound: None if there is none.
    """

    text: str
    quantity: Quantity[StateSet]
    sign: int
    bound: Fraction | None

    @property
    def probability(self) -> bool:
        """Whether it is a P operator."""
        return isinstance(self.quantity, PathProbability)

    @property
    def long_run(self) -> bool:
        """Whether it is a long-run average."""
        return isinstance(self.quantity, LongRunProbability | LongRunReward)

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
        limited = isinstance(self.quantity, PathProbability | LongRunProbability)
        return (min(max(value, 0), 1) if limited else value) + 0


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


def flow_of(context: Context, objectives: Sequence[Objective]) -> ProductFlow:
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
        product, parts = _terms(products, o)
        if limit is not None and counter is not None:
            within = counter.automaton_states(frozenset(range(limit)))
            parts = replace(parts, earning=products.lift(within, since=1))
        if product is not None:
            terms = [t.lifted(product) for t in terms]
            products = products.extended(product)
        terms.append(parts)
    return _equations(products, objectives, terms)


def _terms(products: _Products, objective: Objective) -> tuple[Product | None, _Terms]:
    """What an objective is about, and the product that it needs."""
    quantity, engine = objective.quantity, products.engine
    is_timed = isinstance(quantity, CumulativeReward | LongRunProbability | LongRunReward)
    if engine.model.type.continuous_time and is_timed:
        raise UnsupportedError(
            f"{quantity.feature.value} are not available in multi(...) for "
            f"{engine.model.type.called}"
        )
    match quantity:
        case PathProbability(path):
            ltl = as_ltl(path)
            atoms = tuple(map(products.lift, ltl.atoms))
            ltl = replace(ltl, atoms=atoms, negative=objective.sign < 0)
            inner = products.context.on(engine).without_strategy()
            product, pairs = linear_product(inner, ltl)
            return product, _Terms(accepted=[[avoid, *visits] for avoid, visits in pairs])
        case LongRunProbability(states):
            return None, _Terms(Steps(), products.lift(states))
        case ReachReward(reward, target):
            return _until(products, reward, target)
        case TotalReward(reward) | CumulativeReward(reward) | LongRunReward(reward):
            return None, _Terms(reward, engine.all)
        case _:
            raise UnsupportedError(
                "objectives of multi(...) with R are supported with C, C<=k, S and F states, those "
                "with T with F states"
            )


def _until(products: _Products, reward: Reward, target: StateSet) -> tuple[Product | None, _Terms]:
    """The reward that is earned until states are reached, or for ever if they are not."""
    engine, target = products.engine, products.lift(target)
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
        earned = full(matrix.rows, 0, rational=engine.is_rational)
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
    kind = object if engine.is_rational else np.float64
    of_objectives = np.array(rewards, dtype=kind).reshape(-1, matrix.rows)
    none = np.zeros_like(of_objectives) if not engine.is_rational else 0 * of_objectives
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
    quantity = objective.quantity
    return quantity.window.steps().upper if isinstance(quantity, CumulativeReward) else None


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
