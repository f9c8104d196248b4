"""Step-bounded measures of DTMCs (one row per state) and MDPs (one row per choice).

Every step is one product with the matrix. All terms of a probability are non-negative, so
the rounding error is relative: about (entries per row + 1) * 2**-53 per step, far below 1e-12 for
thousands of steps. Values close to underflow become bounds (`symcheck.numerics.underflow`), and are
0 only where the graph says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.exact_steps import steps_in_integers
from symcheck.check.measures.long_horizons import RestOfSteps, squared_steps
from symcheck.check.measures.signed_steps import (
    REWARD_ERROR,
    BellmanOperator,
    best,
    is_signed,
    signed_steps,
)
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.matrices.numbers import Numbers, is_rational
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics.linear.problem import Progress, largest_width
from symcheck.numerics.tuning import CONSTANT_WIDTH, LIMIT_STEPS, ROUNDING_WIDTH, UNIT_ROUNDOFF
from symcheck.numerics.underflow import enclosed, may_underflow
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = [
    "best",
    "bounded_until",
    "cumulative_reward",
    "instantaneous_reward",
    "lift_bounds",
    "next_probability",
    "prob_greater_zero",
    "relative_error",
]


def next_probability(
    context: Context, target: StateSet, window: Window, direction: Direction | None
) -> Values:
    """Probability that the first step leads into `target` (0 if step 1 is not in the window)."""
    engine = context.engine
    steps = window.steps()
    if steps.lower > 1 or (steps.upper is not None and steps.upper < 1):
        return engine.constant(0)
    system = engine.system(engine.all)
    _note(context, system.n, 1)
    value = best(system.one_step_probability(target), system, direction)
    # If all or none of the successors are in the target, the value is exact in spite of rounding.
    sure = engine.graph.all_successors_in(target)
    never = ~engine.graph.predecessors(target)
    rest = lift_bounds(context, system, [value], system.error, explanation="one step")
    return rest.choose(~(sure | never), engine.indicator(sure))


def bounded_until(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> Values:
    """Probability of `left U[a,b] right`, or of its complement if the path is negative.

    After a steps in `left`, runs satisfy `left U<=b-a right`; `unbounded` computes the probability
    of the latter if there is no b. For the complement, runs that leave `left` before count.
    """
    steps, left, end = path.window.steps(), path.left, int(path.negative)
    if steps.upper is None:
        values = unbounded(context)
    elif steps.upper == steps.lower:  # what holds now, without any arithmetic
        values = context.engine.indicator(~path.right if path.negative else path.right)
    else:
        possible = context.engine.graph.exists_until(left, path.right)
        goal = ~possible if path.negative else path.right
        between = (left - path.right) & possible
        system = context.engine.system(between)
        values = _repeat(
            context,
            system,
            [system.full(end)],
            steps.upper - steps.lower,
            direction,
            system.one_step_probability(goal),
            [(goal, 1.0)],
            grows=not path.negative,
            unbounded=lambda: unbounded(replace(context, relevant_states=None)),
        )
    return (
        values if steps.lower == 0 else _delayed(context, left, values, steps.lower, direction, end)
    )


def prob_greater_zero(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> StateSet:
    """States with a positive probability: computed upper bounds are 0 where the graph says so."""
    zero, _ = bounded_until(context, path, direction, unbounded).compare("<=", 0)
    return ~zero


def _delayed(
    context: Context,
    left: StateSet,
    values: Values,
    steps: int,
    direction: Direction | None,
    outside: int,
) -> Values:
    """Expected value after `steps` steps that all start in `left`; `outside` for other runs."""
    system = context.engine.system(left)
    lost = outside * system.one_step_probability(~left)

    error = relative_error(values.at(context.engine.all))
    sides = [
        best(system.operator.multiply(inside) + enter, system, direction)
        for inside, enter in zip(values.at(left), system.one_step_values(values), strict=True)
    ]
    zero, _ = values.compare("<=", 0)
    sides = enclosed(
        sides[:1] if error is not None else sides,
        lambda: best(system.one_step_probability(~zero), system, direction),
    )
    return _repeat(
        context,
        system,
        sides,
        steps,
        direction,
        lost,
        [(~left, outside)],
        taken=1,
        error=error or 0.0,
    )


def relative_error(bounds: tuple[Numbers, Numbers]) -> float | None:
    """The relative distance of bounds if rounding alone can explain it; else None."""
    low, high = bounds
    if low is high or is_rational(low):
        return 0.0
    if not np.array_equal(low == 0.0, high == 0.0) or (low < 0.0).any():
        return None
    width = largest_width(low, high, relative=True)
    tiny = ((low > 0.0) & (high < UNDERFLOW_MARGIN)).any()
    return 1.01 * width if width <= CONSTANT_WIDTH and not tiny else None


def cumulative_reward(
    context: Context, reward: Reward, window: Window, direction: Direction | None
) -> Values:
    """Expected reward of the first k steps: of their source states and of their transitions."""
    steps = window.steps().upper
    assert steps is not None
    engine = context.engine
    if steps == 0:
        return engine.constant(0)
    system = engine.system(engine.all)
    rewards, zero = system.step_rewards(reward), system.full(0)
    if is_signed(context, rewards):
        signed = BellmanOperator(system, rewards, system.step_reward_errors(reward))
        return signed_steps(context, signed, (zero, zero), steps, direction, "rewards of k steps")
    error = system.reward_error(reward)
    return _repeat(context, system, [zero], steps, direction, rewards, error=error)


def instantaneous_reward(
    context: Context, reward: Reward, time: Fraction, direction: Direction | None
) -> Values:
    """Expected state reward after k steps."""
    engine = context.engine
    steps = Window(upper=time).steps().upper
    assert steps is not None
    system = engine.system(engine.all)
    last = system.state_rewards(reward)
    if steps and is_signed(context, last):
        margin = max(REWARD_ERROR, system.state_reward_error(reward)) * np.abs(last)
        zero = np.zeros(system.rows)
        signed = BellmanOperator(system, zero, zero)
        bounds = last - margin, last + margin
        return signed_steps(context, signed, bounds, steps, direction, "rewards after k steps")
    error = system.state_reward_error(reward)
    if not steps and not is_rational(last):
        return lift_bounds(context, system, [last], error)
    return _repeat(context, system, [last], steps, direction, error=error)


def _repeat(
    context: Context,
    system: System,
    sides: list[Numbers],
    steps: int,
    direction: Direction | None,
    add: Numbers | int = 0,
    rest: Sequence[tuple[StateSet, float]] = (),
    taken: int = 0,
    *,
    error: float = 0.0,
    grows: bool | None = None,
    unbounded: Callable[[], Values] | None = None,
) -> Values:
    """The values after `steps` steps, of which `taken` were taken; `add` is added in each.

    sides: the values so far, or their lower and their upper bounds. rest: values of other states.
    error: of numbers that are not negative, relative, beside that of probabilities.
    grows, unbounded: as in `RestOfSteps`.
    """
    if context.engine.is_rational and not context.engine.model.parameters:
        added = add if isinstance(add, np.ndarray) else system.full(0)[:0]
        whole = steps_in_integers(system, sides[0], added, steps - taken, direction)
        if whole is not None:
            _note(context, system.n, steps)
            return system.lift(whole, None, rest, up_to_rounding=True)
    squared = squared_steps(context, system, sides, steps - taken, add)
    if squared is not None:
        return system.lift(squared[0] * (1.0 - error), squared[1] * (1.0 + error), rest)
    remaining = RestOfSteps(context, system, steps, bool(np.any(add)), grows, unbounded)
    exact = len(sides) == 1 or not np.any(sides[1] - sides[0] > 2 * UNDERFLOW_MARGIN)
    numbers = [*sides, add] if isinstance(add, np.ndarray) else sides
    signed = any(len(x) > 0 and x.min() < 0 for x in numbers)
    least = 1.0 if context.engine.is_rational else context.engine.entry_range[0]
    while taken < steps:
        taken += 1
        following = [_product(system, x, add, direction) for x in sides]
        if any(may_underflow(x, least) for x in sides):
            ones = (sides[-1] != 0) * 1.0
            positive = partial(_product, system, ones, np.greater(add, 0), direction)
            following = enclosed(following, positive, signed=signed)
        if context.observer is not None:
            context.observer(Progress("step by step", taken, 0.0, system.n))
        settled = len(sides) == len(following) and all(map(np.array_equal, sides, following))
        known = settled or remaining.is_known(taken, sides, following)
        before, sides = sides, following
        if known:
            break
    _note(context, system.n, taken)
    if context.engine.is_rational or steps - taken < LIMIT_STEPS:
        # Rounded values that stay the same may hide changes in each of the other steps.
        step = (system.operator.longest + 4) * UNIT_ROUNDOFF + system.error
        rounding = 1.01 * (steps * step + error)
        return lift_bounds(context, system, sides, rounding, rest, up_to_rounding=exact)
    lower, upper = remaining.bounds(taken, before, sides)
    lower, upper = lower - error * np.abs(lower), upper + error * np.abs(upper)
    relevant = context.relevant_states
    members = slice(None) if relevant is None else system.restrict(relevant) > 0
    width = largest_width(lower[members], upper[members], context.options.relative)
    context.warn_if_wide(width, f"{taken:,} of {steps:,} steps were made")
    return system.lift(lower, upper, rest)


def _product(
    system: System, x: Numbers, add: Numbers | int, direction: Direction | None
) -> Numbers:
    return best(system.operator.multiply(x) + add, system, direction)


def lift_bounds(
    context: Context,
    system: System,
    bounds: Sequence[Numbers],
    rounding: float,
    rest: Sequence[tuple[StateSet, float]] = (),
    *,
    up_to_rounding: bool = True,
    explanation: str = "step by step",
) -> Values:
    """Values from numbers, or from their lower and upper bounds, and their relative error.

    rest: values of other states. up_to_rounding: whether bounds differ by underflow only, so that
    those that are within the error of each other are exact up to rounding.
    """
    low, high = bounds[0], bounds[-1]
    up_to_rounding = up_to_rounding and rounding <= ROUNDING_WIDTH
    if is_rational(low):
        return system.lift(low, None, rest, up_to_rounding=True)
    with np.errstate(invalid="ignore"):  # of infinite values
        low, high = (
            np.where(np.isfinite(side), side + sign * rounding * np.abs(side), side)
            for side, sign in ((low, -1.0), (high, 1.0))
        )
    context.warn_if_wide(largest_width(low, high, context.options.relative), explanation)
    return system.lift(low, high, rest, up_to_rounding=up_to_rounding)


def _note(context: Context, unknowns: int, steps: int) -> None:
    context.log.runs.append(SolverRun("steps", "step by step", unknowns, steps))
