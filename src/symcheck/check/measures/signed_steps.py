"""Rewards of both signs, step by step: what cancels leaves an error that is not relative to the
value, so that lower and upper bounds are carried along.
"""

from __future__ import annotations

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.long_horizons import RestOfSteps, squared_steps
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, System, Values
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Floats, best_of_rows
from symcheck.numerics.linear.problem import Progress, largest_width
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LEAST

__all__ = ["REWARD_ERROR", "BellmanOperator", "best", "is_signed", "lifted", "signed_steps"]

REWARD_ERROR = 2.0**-43
"""The relative error of rewards: see `symcheck.engines.tuning.CANCELLATION`."""


def best(rows: Numbers, system: System, direction: Direction | None) -> Numbers:
    """The least or greatest value of the rows of each state: float64[rows] -> float64[n]."""
    return best_of_rows(rows, system.groups, direction, system.opponents)


def is_signed(context: Context, rewards: Numbers) -> bool:
    """Whether rewards in floating point are negative somewhere."""
    return not context.engine.is_rational and bool(rewards.min(initial=0.0) < 0)


@dataclass(frozen=True, eq=False)
class BellmanOperator:
    """The steps x' = rewards + factor A x of the rows of a system, with bounds on their errors.

    Args:
        rewards: per row.
        errors: bounds on the errors of the rewards, per row.
        factor: the discount of later steps.
        loss: 1 minus the discount.
    """

    system: System
    rewards: Floats
    errors: Floats
    factor: float = 1.0
    loss: float = 0.0

    def bounds(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        """Bounds per row on what a step gives, from bounds per state on what comes after it."""
        multiply = self.system.operator.multiply
        largest = np.maximum(np.abs(lower), np.abs(upper))
        size = self.factor * multiply(largest) + np.abs(self.rewards)
        some = size > 0.0
        if self.factor and not some.all():  # of products that underflow
            some |= multiply((largest > 0.0).astype(np.float64)) > 0.0
        unit = 2 * (self.system.operator.longest + 6) * UNIT_ROUNDOFF + self.system.error
        tiny = (self.system.operator.longest + 6) * LEAST
        error = np.where(some, unit * size + self.errors + tiny, 0.0)
        return (
            self.factor * multiply(lower) + self.rewards - error,
            self.factor * multiply(upper) + self.rewards + error,
        )


def signed_steps(
    context: Context,
    steps: BellmanOperator,
    start: tuple[Floats, Floats],
    count: int,
    direction: Direction | None,
    name: str,
) -> Values:
    """The values after some steps.

    Many steps of a small chain are squared, and others end where the rest is known.

    Args:
        context: the engine, the options and the log.
        steps: makes a step.
        start: lower and upper bounds on the values after the last step.
        count: the number of steps.
        direction: minimise or maximise over strategies; None for a chain.
        name: of the measure, for a warning.
    """
    system = steps.system
    lower, upper = start
    if steps.loss == 0.0:
        squared = squared_steps(context, system, [lower, upper], count, steps.rewards, steps.errors)
        if squared is not None:
            return lifted(context, system, *squared, name)
    earns = bool(np.any(steps.rewards))
    remaining = RestOfSteps(context, system, count, earns, loss=steps.loss, outward=True)
    taken, is_cut = 0, False
    while taken < count:
        taken += 1
        low, high = (best(rows, system, direction) for rows in steps.bounds(lower, upper))
        if context.observer is not None:
            context.observer(Progress("step by step", taken, 0.0, system.n))
        if np.array_equal(low, lower) and np.array_equal(high, upper):
            break
        is_cut = remaining.is_known(taken, [lower, upper], [low, high])
        if is_cut:
            lower, upper = remaining.bounds(taken, [lower, upper], [low, high])
            break
        lower, upper = low, high
    context.log.runs.append(SolverRun("steps", "step by step", system.n, taken))
    made = f"{taken:,} of {count:,} steps were made" if is_cut else ""
    return lifted(context, system, lower, upper, name, made)


def lifted(
    context: Context, system: System, lower: Floats, upper: Floats, name: str, reason: str = ""
) -> Values:
    """Bounds as values: exact up to rounding where they are close, with a warning where they are
    not: of the reason, or of numbers with this name that cancel.
    """
    # Not by `largest_width`, for which what is below the margin of underflow is no width.
    if np.all(upper - lower <= ROUNDING * np.minimum(np.abs(lower), np.abs(upper))):
        return system.lift(lower, upper, up_to_rounding=True)
    relevant = np.ones(len(lower), np.bool_)
    if context.relevant_states is not None:
        relevant = system.restrict(context.relevant_states) > 0
    width = largest_width(lower[relevant], upper[relevant], context.options.relative)
    context.warn_if_wide(width, reason or f"{name}: positive and negative ones cancel")
    return system.lift(lower, upper)
