"""Bounds on rewards in whole steps: rewards that are multiples of a common step are counted in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import reduce
from math import ceil, floor, gcd, isfinite, isinf

import numpy as np

from symcheck.check.context import Context
from symcheck.engines.base import System
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int64s
from symcheck.semantics.time_bounds import Count, Window

__all__ = ["Limits", "common_step", "in_steps", "main_first", "scaled"]

_DENOMINATOR = 1_000_000
_LEVELS = 100_000_000
_NEAR = 8 * 2.0**-53
"""How far a reward, a sum of few doubles, may be from the fraction that it is taken for (relative)."""


@dataclass(frozen=True, eq=False)
class Limits:
    """A reward per row in whole steps, and from how many to how many (None: any number) there may be."""

    rewards: Int64s = field(repr=False)
    lower: int
    upper: int | None

    @property
    def empty(self) -> bool:
        """Whether no number of steps is within the bounds."""
        return self.upper is not None and self.upper < self.lower

    @property
    def levels(self) -> int:
        """How many budgets there are."""
        return (self.lower if self.upper is None else self.upper) + 1


def main_first(limit: Limits) -> tuple[bool, int]:
    """A key to sort by: first what is counted level by level; the others are counted in the states.

    That must be one with an end wherever one has an end: without, the lowest level is reachability without limits, where no
    mass may be missing, and copies that count up to an end lose some. Of several, the one with the most levels.
    """
    return limit.upper is None, -limit.levels


def in_steps(window: Window, step: Fraction) -> tuple[int, int | None]:
    """The bounds, in steps of that size."""
    lower = floor(window.lower / step) + 1 if window.lower_strict else ceil(window.lower / step)
    if window.upper is None:
        return lower, None
    return lower, ceil(window.upper / step) - 1 if window.upper_strict else floor(
        window.upper / step
    )


def common_step(values: list[Fraction]) -> Fraction:
    """The greatest number that all (not negative) values are multiples of; 1 where all are 0."""
    some = [v for v in values if v]
    if not some:
        return Fraction(1)
    denominator = reduce(lambda a, b: a * b // gcd(a, b), (v.denominator for v in some))
    return Fraction(reduce(gcd, (int(v * denominator) for v in some)), denominator)


def scaled(context: Context, system: System, rewards: Numbers, count: Count) -> Limits:
    """Rewards (float64[rows]) and bounds in whole steps.

    Raises UnsupportedError where a reward is negative, infinite or no multiple of a common step, and names it with a state.
    """
    distinct, inverse = np.unique(rewards, return_inverse=True)
    exact = context.engine.exact
    represented = Fraction if exact else _fraction
    values: list[Fraction] = []
    for i, v in enumerate(distinct.tolist()):
        nearest = represented(Fraction(v)) if isfinite(v) and v >= 0 else None
        if nearest is None:
            raise _refused(context, system, v, int(np.flatnonzero(inverse == i)[0]))
        values.append(nearest)
    step = common_step(values)
    lower, upper = in_steps(count.window if exact else _meant(count.window), step)
    if max(lower, upper or 0) > _LEVELS:
        raise UnsupportedError(
            f"a bound of {max(lower, upper or 0):,} steps of {step}, the greatest number that all rewards are multiples of, is too fine\n"
            "  hint: round the rewards to fewer digits"
        )
    steps = np.array([min(int(v / step), _LEVELS + 1) for v in values], dtype=np.int64)
    return Limits(steps[inverse], lower, upper)


def _fraction(value: Fraction) -> Fraction | None:
    """The fraction with a small denominator that a double stands for."""
    nearest = value.limit_denominator(_DENOMINATOR)
    return nearest if abs(nearest - value) <= _NEAR * abs(value) else None


def _meant(window: Window) -> Window:
    """The bounds, where they were computed in floating point (such as 4/3), as the fractions that they stand for."""
    upper = window.upper if window.upper is None else _fraction(window.upper) or window.upper
    return replace(window, lower=_fraction(window.lower) or window.lower, upper=upper)


def _refused(
    context: Context, system: System, value: float | Fraction, row: int
) -> UnsupportedError:
    groups = system.groups
    place = row if groups is None else int(np.searchsorted(groups, row, side="right")) - 1
    members = np.zeros(context.engine.states, np.bool_)
    members[np.flatnonzero(context.engine.to_bools(system.states))[place]] = True
    state = context.example(context.engine.from_bools(members))
    what = (
        "negative"
        if value < 0
        else "infinite"
        if isinf(value)
        else "no fraction with a denominator up to a million"
    )
    return UnsupportedError(
        f"a bound on a reward needs rewards that are multiples of a common step: {value} in state {state} is {what}"
    )
