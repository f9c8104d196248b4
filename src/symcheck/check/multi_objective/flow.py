"""The flow of a multi-objective query, on the product with a step counter and automata."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

import numpy as np

from symcheck.check.context import Context
from symcheck.check.omega_regular.ltl import linear_product
from symcheck.check.path_formulas import StatesOf, TemporalPath, temporal
from symcheck.check.reward_queries import reward_of
from symcheck.engines.base import Engine, Number, Product, StateSet
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, Int32s
from symcheck.numerics.graph import Incidence
from symcheck.numerics.multi_objective import linear_program as numerics
from symcheck.semantics.time_bounds import window
from symcheck.syntax.ast import CumulativeReward, ProbabilityOperator, RewardOperator

__all__ = ["Objective", "flow_of"]


@dataclass(frozen=True)
class Objective:
    """One objective. sign: 1 to maximise, -1 to minimise. bound: None if there is none."""

    formula: ProbabilityOperator | RewardOperator
    sign: int
    bound: Fraction | None

    @property
    def probability(self) -> bool:
        """Whether it is a P operator."""
        return isinstance(self.formula, ProbabilityOperator)

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
        return (min(1, max(0, value)) if self.probability else value) + 0


@dataclass(frozen=True)
class _Steps:
    """An automaton with one letter that counts steps up to a limit."""

    table: Int32s
    initial: int = 0


def flow_of(
    context: Context, objectives: Sequence[Objective], states_of: StatesOf
) -> numerics.Flow:
    """The flow of the product with a step counter and with an automaton per P objective."""
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
        path = temporal(o.formula.path, states_of, context.engine.model)
        lifted = tuple((e, chain.lift(s)) for e, s in path.sets)
        path = TemporalPath(path.form, lifted, negative=o.sign < 0)
        product, pairs = linear_product(replace(context, engine=chain.engine), path)
        accepted = [_lifted(product, a) for a in accepted]
        accepted.append([[avoid, *visits] for avoid, visits in pairs])
        chain = chain.extended(product)
    counts = {k: chain.lift(s, since=len(before.products)) for k, s in counts.items()}
    return _equations(chain, objectives, limits, counts, accepted)


def _equations(
    chain: _Chain,
    objectives: Sequence[Objective],
    limits: Sequence[int | None],
    counts: dict[int, StateSet],
    accepted: Sequence[list[list[StateSet]] | None],
) -> numerics.Flow:
    engine = chain.engine
    matrix = engine.system(engine.all).matrix
    assert matrix.groups is not None
    rewards: list[Numbers] = []
    costless = np.ones(matrix.rows, dtype=np.bool_)
    for o, k in zip(objectives, limits, strict=True):
        own = full(matrix.rows, 0, exact=engine.exact)
        if isinstance(o.formula, RewardOperator):
            own = engine.system(engine.all).step_rewards(reward_of(chain.context, o.formula))
            if (own < 0).any():
                raise UnsupportedError("negative rewards in multi(...) are not supported")
            if k is not None:
                own = np.where(matrix.rows_of(engine.to_bools(counts[k])), own, 0 * own)
            if o.sign < 0:
                costless &= np.asarray(own == 0, dtype=np.bool_)
        rewards.append(o.sign * own)

    def bools(pairs: list[list[StateSet]]) -> list[tuple[Bools, list[Bools]]]:
        return [
            (engine.to_bools(avoid), [engine.to_bools(v) for v in visits])
            for avoid, *visits in pairs
        ]

    stays = numerics.settling(
        Incidence(matrix), costless, [None if a is None else bools(a) for a in accepted]
    )
    initial = int(np.flatnonzero(engine.to_bools(engine.initial))[0])
    kind = object if engine.exact else np.float64
    return numerics.Flow(
        matrix, initial, np.array(rewards, dtype=kind).reshape(-1, matrix.rows), stays
    )


def _lifted(product: Product, pairs: list[list[StateSet]] | None) -> list[list[StateSet]] | None:
    return None if pairs is None else [[product.lift(s) for s in sets] for sets in pairs]


def _limit(objective: Objective) -> int | None:
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
    """A sequence of products, each of the previous one."""

    context: Context
    products: tuple[Product, ...] = ()

    @property
    def engine(self) -> Engine:
        return self.products[-1].engine if self.products else self.context.engine

    def extended(self, product: Product) -> _Chain:
        return _Chain(self.context, (*self.products, product))

    def lift(self, states: StateSet, since: int = 0) -> StateSet:
        """A set of the engine after `since` products, lifted to the last product."""
        for product in self.products[since:]:
            states = product.lift(states)
        return states
