"""Strategies whose memory counts steps or rewards."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reward_bounded_until import row_rewards
from symcheck.check.measures.reward_scaling import ScaledBound, scale_bound
from symcheck.check.strategies.builder import StrategyBuilder
from symcheck.check.strategies.counters import counter_product
from symcheck.check.strategies.to_explicit import rows_engine
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, erased
from symcheck.engines.explicit.strategy import Strategy
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, first_best, per_row
from symcheck.semantics.time_bounds import RewardWindow

__all__ = ["first_steps", "within_rewards"]


def within_rewards(
    context: Context,
    left: StateSet,
    right: StateSet,
    counts: Sequence[RewardWindow],
    towards: Direction,
    direction: Direction,
) -> Strategy:
    """A strategy of the product with a counter for each bounded reward."""
    explicit = rows_engine(context)
    system = context.engine.system(context.engine.all)
    product = counter_product(
        explicit,
        [scale_bound(context, system, row_rewards(context, system, c), c) for c in counts],
    )
    builder = StrategyBuilder(context.on(erased(product.engine)), towards)
    to, of = context.engine.to_bools, builder.engine.from_bools
    builder.until(
        of(to(left)[product.state] & product.within), of(to(right)[product.state] & product.met)
    )
    return builder.strategy(direction, product.code, product.entry)


def first_steps(
    context: Context,
    rewards: Numbers | None,
    steps: int,
    direction: Direction,
    factor: Fraction = Fraction(1),
    last: Numbers | None = None,
    ended: Bools | None = None,
    of: Direction | None = None,
) -> Strategy:
    """A strategy for the reward of the first steps, whose memory is the number of steps so far.

    Args:
        context: the explicit engine.
        rewards: the reward of each row; None: no reward.
        steps: the number of steps that count.
        direction: minimise or maximise.
        factor: the discount per step.
        last: the reward of each state after these steps; None: none.
        ended: the states that keep that reward for ever, bool[states]; None: there are none.
        of: the direction of the strategy, if it is not this one.
    """
    explicit = rows_engine(context)
    matrix = explicit.matrix
    assert matrix.groups is not None
    ones = np.ones(matrix.rows, np.int64)
    product = counter_product(explicit, [ScaledBound(ones, steps, None)])
    system = context.engine.system(context.engine.all)
    sign = np.full(system.n, 1 if direction is Direction.MAX else -1)
    if system.opponents is not None:
        sign[system.opponents] *= -1
    sign = per_row(system.groups, sign)
    x = system.full(0) if last is None else last
    rows = np.tile(matrix.groups[:-1], (steps + 1, 1))
    discount: Numbers = full(1, factor, rational=context.engine.is_rational)
    for left in range(1, steps + 1):
        y = np.asarray(system.operator.multiply(x)) * discount
        y = y if rewards is None else y + rewards
        rows[steps - left] = first_best(sign * y, matrix.groups)
        best = y[rows[steps - left]]
        x = best if ended is None else np.where(ended, x, best)
    groups = product.engine.matrix.groups
    assert groups is not None
    chosen = groups[:-1] + (rows - matrix.groups[:-1]).T.ravel()
    return Strategy(
        product.engine, chosen, of or direction, product.code < steps, product.code, product.entry
    )
