"""Reward bounds in whole steps, for rewards that are multiples of a common step."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import reduce
from math import ceil, floor, gcd, inf

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.engines.base import System
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int64s
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.time_bounds import RewardWindow, Window

__all__ = [
    "ScaledBound",
    "common_step",
    "dimension_order",
    "in_multiples",
    "in_steps",
    "scale_bound",
]

_NEAR = 8 * UNIT_ROUNDOFF
"""Largest relative distance of a reward, a sum of few doubles, from the fraction it stands for."""


@dataclass(frozen=True, eq=False)
class ScaledBound:
    """A bounded reward in whole steps.

    Attributes:
        rewards: the reward of each row, int64[rows].
        lower: the least total reward.
        upper: the greatest total reward; None: no upper bound.
    """

    rewards: Int64s = field(repr=False)
    lower: int
    upper: int | None

    @property
    def empty(self) -> bool:
        """Whether no number of steps is within the bounds."""
        return self.upper is not None and self.upper < self.lower

    @property
    def levels(self) -> int:
        """The number of budgets."""
        return (self.lower if self.upper is None else self.upper) + 1


def dimension_order(bound: ScaledBound) -> tuple[bool, int]:
    """A sort key of dimensions.

    The first dimension is unfolded level by level; the remaining ones are encoded in the product
    states. If some dimension has an upper bound, the first one must have one: otherwise its lowest
    level is unbounded reachability, which requires rows that sum to 1, and rows of an encoded
    dimension lose mass beyond its upper bound. Among these, the one with the most levels is first.
    """
    return bound.upper is None, -bound.levels


def in_steps(window: Window, step: Fraction) -> tuple[int, int | None]:
    """The lower and the upper bound of a window as whole numbers of steps."""
    lower = floor(window.lower / step) + 1 if window.lower_strict else ceil(window.lower / step)
    if window.upper is None:
        return lower, None
    return lower, ceil(window.upper / step) - 1 if window.upper_strict else floor(
        window.upper / step
    )


def common_step(values: list[Fraction]) -> Fraction:
    """The greatest common divisor of non-negative fractions; 1 if all are 0."""
    some = [v for v in values if v]
    if not some:
        return Fraction(1)
    denominator = reduce(lambda a, b: a * b // gcd(a, b), (v.denominator for v in some))
    return Fraction(reduce(gcd, (int(v * denominator) for v in some)), denominator)


def scale_bound(
    context: Context, system: System, rewards: Numbers, count: RewardWindow
) -> ScaledBound:
    """A bounded reward in whole steps.

    Args:
        context: the engine.
        system: the states and rows of the rewards.
        rewards: float64[rows], or rationals.
        count: the reward and its bounds.

    Raises:
        UnsupportedError: a reward is negative, infinite or not a multiple of a common step. The
            message names the reward and a state.
    """
    multiples, step = in_multiples(context, system, rewards)
    exact = context.engine.is_rational
    lower, upper = in_steps(count.window if exact else _as_fractions(count.window), step)
    largest = max(lower, upper or 0)
    if largest > tuning.REWARD_LEVELS:
        raise UnsupportedError(
            f"a bound of {largest:,} steps of {step}, the greatest common divisor of all "
            "rewards, is too large",
            hint="round the rewards to fewer digits",
        )
    return ScaledBound(multiples, lower, upper)


def in_multiples(context: Context, system: System, rewards: Numbers) -> tuple[Int64s, Fraction]:
    """Rewards as multiples of a common step, int64[rows], and the step.

    Very large ones are cut off. Raises UnsupportedError: see `scale_bound`.
    """
    distinct, inverse = np.unique(rewards, return_inverse=True)
    exact = context.engine.is_rational
    represented = Fraction if exact else _fraction
    values: list[Fraction] = []
    for i, v in enumerate(distinct.tolist()):
        nearest = represented(Fraction(v)) if 0 <= v < inf else None
        if nearest is None:
            raise _not_a_multiple(context, system, v, int(np.flatnonzero(inverse == i)[0]))
        values.append(nearest)
    step = common_step(values)
    steps = np.array([min(int(v / step), tuning.REWARD_LEVELS + 1) for v in values], dtype=np.int64)
    return steps[inverse], step


def _fraction(value: Fraction) -> Fraction | None:
    """The fraction with a small denominator that a double stands for; None if there is none."""
    nearest = value.limit_denominator(tuning.LARGEST_DENOMINATOR)
    return nearest if abs(nearest - value) <= _NEAR * abs(value) else None


def _as_fractions(window: Window) -> Window:
    """The window with bounds that were computed in floating point, such as 4/3, as fractions."""
    upper = window.upper if window.upper is None else _fraction(window.upper) or window.upper
    return replace(window, lower=_fraction(window.lower) or window.lower, upper=upper)


def _not_a_multiple(
    context: Context, system: System, value: float | Fraction, row: int
) -> UnsupportedError:
    groups = system.groups
    index = row if groups is None else int(np.searchsorted(groups, row, side="right")) - 1
    members = np.zeros(context.engine.states, np.bool_)
    members[np.flatnonzero(context.engine.to_bools(system.states))[index]] = True
    state = context.example(context.engine.from_bools(members))
    description = (
        "negative"
        if value < 0
        else "infinite"
        if value == inf
        else "not a fraction with a denominator up to a million"
    )
    return UnsupportedError(
        "a bound on a reward needs rewards that are multiples of a common step: "
        f"{value} in state {state} is {description}"
    )
