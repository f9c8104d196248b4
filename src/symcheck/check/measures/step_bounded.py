"""Step-bounded measures of DTMCs (one row per state) and MDPs (one row per choice).

Every step is one product with the matrix. All terms of a probability are non-negative, so
the rounding error is relative: about (entries per row + 1) * 2**-53 per step, far below 1e-12 for
thousands of steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.signed_steps import (
    REWARD_ERROR,
    Steps,
    best,
    is_signed,
    signed_steps,
)
from symcheck.check.path_formulas import UntilPath
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, System, Values
from symcheck.matrices.numbers import Numbers
from symcheck.numerics.linear.problem import Progress
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = [
    "best",
    "bounded_until",
    "cumulative_reward",
    "instantaneous_reward",
    "next_probability",
    "prob_greater_zero",
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
    rest = system.lift(value, None, exact=True)
    return rest.choose(~(sure | never), engine.indicator(sure))


def bounded_until(
    context: Context,
    path: UntilPath,
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
        )
    return (
        values if steps.lower == 0 else _delayed(context, left, values, steps.lower, direction, end)
    )


def prob_greater_zero(
    context: Context, left: StateSet, right: StateSet, window: Window, direction: Direction | None
) -> StateSet | None:
    """None: the values decide, as products of positive numbers are positive and zeros are exact."""
    return None


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

    sides = [
        best(system.operator.multiply(inside) + enter, system, direction)
        for inside, enter in zip(values.at(left), system.one_step_values(values), strict=True)
    ]
    sides = sides[:1] if values.exact else sides
    return _repeat(context, system, sides, steps, direction, lost, [(~left, outside)], taken=1)


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
        signed = Steps(system, rewards, system.step_reward_errors(reward))
        return signed_steps(context, signed, (zero, zero), steps, direction, "rewards of k steps")
    return _repeat(context, system, [zero], steps, direction, rewards)


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
        error = REWARD_ERROR * np.abs(last)
        zero = np.zeros(len(system.row_sums()))
        signed = Steps(system, zero, zero)
        bounds = last - error, last + error
        return signed_steps(context, signed, bounds, steps, direction, "rewards after k steps")
    return _repeat(context, system, [last], steps, direction)


def _repeat(
    context: Context,
    system: System,
    sides: list[Numbers],
    steps: int,
    direction: Direction | None,
    add: Numbers | int = 0,
    rest: Sequence[tuple[StateSet, float]] = (),
    taken: int = 0,
) -> Values:
    """The values after `steps` steps, of which `taken` were taken; `add` is added in each.

    sides: the values so far, or their lower and their upper bounds. rest: values of other states.
    """
    while taken < steps:
        taken += 1
        following = [best(system.operator.multiply(x) + add, system, direction) for x in sides]
        if context.observer is not None:
            context.observer(Progress("step by step", taken, 0.0, system.n))
        if all(map(np.array_equal, sides, following)):
            break
        sides = following
    _note(context, system.n, taken)
    return _lift(context, system, sides[0], sides[-1], rest, taken)


def _lift(
    context: Context,
    system: System,
    low: Numbers,
    high: Numbers,
    rest: Sequence[tuple[StateSet, float]],
    steps: int,
) -> Values:
    """Values that include the rounding error of the given number of steps."""
    exact = context.engine.exact
    rounding = 0.0 if exact else steps * 2 * (system.operator.longest + 2) * UNIT_ROUNDOFF
    if high is low and rounding <= ROUNDING:
        return system.lift(low, None, rest, exact=True)
    return system.lift(low - rounding * np.abs(low), high + rounding * np.abs(high), rest)


def _note(context: Context, unknowns: int, steps: int) -> None:
    context.log.runs.append(SolverRun("steps", "step by step", unknowns, steps))
