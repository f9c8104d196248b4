"""Step-bounded measures of models with intervals of probabilities.

Every step is a best expectation over all states, whose lower and upper bounds are rounded outwards.
See `symcheck.check.measures.base`; nature's direction is known to the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.engines.capabilities import HasBestExpectations
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import best_of_rows
from symcheck.numerics.linear.intervals import require_signs
from symcheck.numerics.linear.problem import Progress, largest_width
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = [
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
    engine, steps = context.engine, window.steps()
    if steps.lower > 1 or (steps.upper is not None and steps.upper < 1):
        return engine.constant(0)
    values = _Steps(context, direction).made(engine.indicator(target), 1)
    sure = engine.graph.all_successors_in(target)
    never = ~engine.graph.predecessors(target)
    return values.choose(~(sure | never), engine.indicator(sure))


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
    engine, steps, left = context.engine, path.window.steps(), path.left
    goal, missed = (~path.right, 1) if path.negative else (path.right, 0)
    make = _Steps(context, direction)
    if steps.upper is None:
        values = unbounded(context)
    else:
        possible = engine.graph.exists_until(left, path.right)
        between = (left - path.right) & possible
        values = make.made(engine.indicator(goal), steps.upper - steps.lower, within=between)
    return make.made(values, steps.lower, within=left, elsewhere=missed) if steps.lower else values


def prob_greater_zero(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> StateSet:
    """States with a positive probability: computed upper bounds are 0 where the graph says so."""
    zero, _ = bounded_until(context, path, direction, unbounded).compare("<=", 0)
    return ~zero


def cumulative_reward(
    context: Context, reward: Reward, window: Window, direction: Direction | None
) -> Values:
    """Expected reward of the first k steps: of their source states and of their transitions."""
    steps = window.steps().upper
    assert steps is not None
    engine = context.engine
    system = engine.system(engine.all)
    rewards, error = system.step_rewards(reward), system.reward_error(reward)
    return _Steps(context, direction).made(engine.constant(0), steps, rewards, error=error)


def instantaneous_reward(
    context: Context, reward: Reward, time: Fraction, direction: Direction | None
) -> Values:
    """Expected state reward after k steps."""
    engine, steps = context.engine, Window(upper=time).steps().upper
    assert steps is not None
    system = engine.system(engine.all)
    last = system.lift(system.state_rewards(reward), None)
    error = system.state_reward_error(reward)
    return _Steps(context, direction).made(last, steps, error=error)


@dataclass(frozen=True)
class _Steps:
    """Steps of the player and nature, in a context."""

    context: Context
    direction: Direction | None

    def made(
        self,
        values: Values,
        steps: int,
        add: Numbers | None = None,
        *,
        error: float | None = None,
        within: StateSet | None = None,
        elsewhere: int | None = None,
    ) -> Values:
        """The best expectation of values after some steps.

        Args:
            values: at the end.
            steps: their number.
            add: per row, what a step earns.
            error: that of rewards, relative; None: values are probabilities.
            within: the states from which steps are made; None: all. Others keep their values, or
                have the value `elsewhere`.
            elsewhere: that value.

        Raises:
            UnsupportedError: a number is negative, in doubles.
        """
        context, engine = self.context, self.context.engine
        expectations = engine.capability(HasBestExpectations)
        assert expectations is not None
        sides = list(values.at(engine.all))
        require_signs(*sides)
        system = engine.system(engine.all)
        move = None if within is None else engine.to_bools(within)
        fixed = None if elsewhere is None else list(engine.constant(elsewhere).at(engine.all))
        taken = 0
        while taken < steps:
            before, taken = sides, taken + 1
            rows = expectations.best_expectations(sides[0], sides[1], self.direction)
            if add is not None:
                rows = rows[0] + add, rows[1] + add
            sides = [best_of_rows(r, system.groups, self.direction) for r in rows]
            if move is not None:
                kept = before if fixed is None else fixed
                sides = [np.where(move, s, k) for s, k in zip(sides, kept, strict=True)]
            if context.observer is not None:
                context.observer(Progress("step by step", taken, 0.0, engine.states))
            if all(map(np.array_equal, sides, before)):
                break
        context.log.runs.append(SolverRun("steps", "step by step", engine.states, taken))
        if engine.is_rational:
            return system.lift(sides[0], None)
        rounding = 0.0 if error is None else 1.01 * (taken * 2.0**-52 + error) + 2.0**-52
        low, high = sides[0] * (1.0 - rounding), sides[1] * (1.0 + rounding)
        width = largest_width(low, high, context.options.relative)
        context.warn_if_wide(width, "step by step")
        return system.lift(low, high)
