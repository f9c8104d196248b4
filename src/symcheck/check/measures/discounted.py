"""Discounted rewards of DTMCs and MDPs: the reward of step i counts discount^i times (from i = 0).

The total discounted reward is the only solution of x = opt(r + discount P x), a contraction. Where
rows are available, its equations are solved as other linear problems; otherwise values are
iterated, and the bounds of MacQueen end the iteration.

Sources: Puterman (1994), Markov Decision Processes, chapter 6 (also for the bounds).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.exact_steps import steps_in_integers
from symcheck.check.measures.long_horizons import RestOfSteps
from symcheck.check.measures.signed_steps import (
    BellmanOperator,
    best,
    is_signed,
    lifted,
    signed_steps,
)
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, System, Values
from symcheck.engines.linear_system import chosen_rows
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite
from symcheck.matrices.rows import Floats, per_row
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics.linear.problem import LinearProblem, Progress, Solution, largest_width
from symcheck.numerics.tuning import SERIES_ENTRIES, STEP_ENTRIES, UNIT_ROUNDOFF
from symcheck.numerics.underflow import enclosed, may_underflow
from symcheck.semantics.rewards import Reward

__all__ = ["discounted_reward", "solved_discounted"]

_NAME = "discounted rewards"
_HORIZONS = 64.0
"""After 64 / (1 - discount) steps, the remaining reward is at most exp(-64) < 2e-28 of the largest
value."""


def discounted_reward(
    context: Context,
    reward: Reward,
    discount: Fraction,
    steps: int | None,
    direction: Direction | None,
) -> Values:
    """Expected discounted reward of the first steps, from each state.

    Args:
        context: the engine, the options and the log.
        reward: what is counted: of step i, the state that is left and the transition.
        discount: the factor per step, at least 0 and less than 1.
        steps: the number of steps; None: all of them.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Certified values, rationals on the exact engine.

    Raises:
        UnsupportedError: the model is a CTMC, or the reward of a step is infinite.
    """
    engine = context.engine
    if engine.model.type.continuous_time:
        raise UnsupportedError(
            "discounted rewards are supported for DTMCs and MDPs, where a factor applies to each "
            "step; in a CTMC, R [ C<=t ] and R [ S ] are supported"
        )
    system = engine.system(engine.all, direction)
    rewards = system.step_rewards(reward)
    if is_infinite(rewards).any():
        raise UnsupportedError("discounted rewards need finite rewards, and one of a step is not")
    if steps == 0:
        return engine.constant(0)
    if discount == 0 and steps is None:
        steps = 1  # and 0^0 is 1
    signed = None
    is_long = steps is not None and not engine.is_rational and _is_long(steps, discount)
    if is_long or is_signed(context, rewards):
        errors = system.step_reward_errors(reward)
        signed = BellmanOperator(system, rewards, errors, float(discount), float(1 - discount))
    if steps is not None:
        if signed is not None:
            zero = system.full(0)
            return signed_steps(context, signed, (zero, zero), steps, direction, _NAME)
        return _iterated(context, system, rewards, discount, steps, direction)
    if not (system.has_rows or engine.is_rational):
        if float(discount) == 1.0:
            raise UnsupportedError(
                "the discount rounds to 1 in floating point, so that iteration does not converge",
                hint="use -exact, or an engine with rows (-ex, -s)",
            )
        return _iterated(context, system, rewards, discount, None, direction)
    solution = solved_discounted(context, system, rewards, discount, direction)
    if engine.is_rational or not solution.certified:
        return system.lift(solution.middle, None, up_to_rounding=True)
    bounds = solution.lower, solution.upper
    rounding = _Rounding(system, rewards, discount, None)
    margins = rounding.margins(bounds[1], _largest(*bounds))
    if signed is not None:
        return _around(context, signed, discount, bounds, margins, direction)
    return _lifted(context, rounding, bounds, margins)


def solved_discounted(
    context: Context,
    system: System,
    rewards: Numbers,
    discount: Fraction,
    direction: Direction | None,
) -> Solution:
    """The solution of the equations over all states; the arguments are as for
    `discounted_problem`.
    """
    from symcheck.numerics.linear.methods import solve_linear

    def solve() -> Solution:
        problem = discounted_problem(system, rewards, discount, direction)
        found = solve_linear(problem, context.options, context.observer)
        how = found.iterations, found.explanation, found.certified
        context.log.runs.append(SolverRun("linear", found.method, system.n, *how))
        return found

    return context.once(("discounted", direction, context.options.epsilon), solve)


def _around(
    context: Context,
    signed: BellmanOperator,
    discount: Fraction,
    bounds: tuple[Floats, Floats],
    margins: Floats,
    direction: Direction | None,
) -> Values:
    """Bounds on values of both signs, from bounds of the same error for all states.

    The error e(s) of an approximation x is at most that of the rows a that may be optimal: the
    residual of the row, its rounding error, and discount P_a e. This is a discounted reward too.

    Args:
        context: the engine, the options and the log.
        signed: a step.
        discount: the factor per step, at least 0 and less than 1.
        bounds: computed lower and upper bounds, float64[n], wrong by at most `margins`.
        margins: the errors of `bounds`, float64[n].
        direction: as for `discounted_reward`.
    """
    from symcheck.numerics.linear.methods import solve_linear

    system = signed.system
    lower, upper = bounds[0] - margins, bounds[1] + margins
    x = 0.5 * (bounds[0] + bounds[1])
    low, high = signed.bounds(lower, upper)
    least, most = best(low, system, direction), best(high, system, direction)
    maximises = direction is Direction.MAX
    optimal = (
        high >= per_row(system.groups, least) if maximises else low <= per_row(system.groups, most)
    )
    below, above = signed.bounds(x, x)
    excess = np.maximum(above - per_row(system.groups, x), 0.0)
    deficit = np.maximum(per_row(system.groups, x) - below, 0.0)
    # The chosen rows bound the value from one side, and all that may be optimal from the other.
    chosen = 0.5 * (below + above)
    chosen = chosen == per_row(system.groups, best(chosen, system, direction))
    wanted, other = (excess, deficit) if maximises else (deficit, excess)
    residual = np.where(chosen, np.maximum(wanted, other), wanted)
    upwards = None if direction is None else Direction.MAX
    problem = discounted_problem(system, residual, discount, upwards)
    if direction is not None:
        problem = chosen_rows(problem, system.matrix, optimal | chosen)
    error = solve_linear(problem, context.options, context.observer).upper * (1.0 + 1e-6)
    lower, upper = np.maximum(lower, x - error), np.minimum(upper, x + error)
    return lifted(context, system, lower, upper, _NAME)


def discounted_problem(
    system: System, rewards: Numbers, discount: Fraction, direction: Direction | None
) -> LinearProblem:
    """The equations x = opt(rewards + discount P x): each step ends with probability 1 - discount.

    Args:
        system: the equations over all states.
        rewards: the reward of a step by each row.
        discount: between 0 and 1.
        direction: minimise or maximise; None for a chain.
    """
    matrix, exact = system.matrix, system.matrix.is_rational
    factor = discount if exact else float(discount)
    end = full(len(rewards), 1 - discount, rational=exact)
    data = matrix.data * factor
    return LinearProblem(
        rewards,
        replace(matrix, data=data),
        None,
        end,
        direction,
        probability=False,
        error=system.error + 4 * UNIT_ROUNDOFF,
    )


def _is_long(steps: int, discount: Fraction) -> bool:
    """Whether too many steps matter to make them one by one."""
    horizon = -2.0 * _HORIZONS / math.log1p(-float(1 - discount)) if discount else 1.0
    return min(steps, horizon) * STEP_ENTRIES > SERIES_ENTRIES


def _iterated(
    context: Context,
    system: System,
    rewards: Numbers,
    discount: Fraction,
    steps: int | None,
    direction: Direction | None,
) -> Values:
    """The values after some steps, or bounds on those of infinitely many, by iteration."""
    exact, options = context.engine.is_rational, context.options
    if exact and steps is not None:
        zero = system.full(0)
        whole = steps_in_integers(system, zero, rewards, steps, direction, discount)
        if whole is not None:
            context.log.runs.append(SolverRun("steps", "step by step", system.n, steps))
            return system.lift(whole, None, up_to_rounding=True)
    digits = RestOfSteps(context, system, steps, earns=True) if exact and steps else None
    factors = full(1, discount, rational=exact)
    factor = factors[0]
    later = full(1, discount / (1 - discount), rational=exact)[0]
    rounding = _Rounding(system, rewards, discount, steps)
    # The omitted tail is below `later` in `_Rounding.margins`.
    negligible = 0.0 if exact else UNIT_ROUNDOFF**2 * float(1 - discount)
    x = lower = upper = system.full(0)
    remaining, taken, width, largest, margin = 1.0, 0, np.inf, 0.0, 0.0
    least = 1.0 if exact else context.engine.entry_range[0] * float(factor)
    while taken < (options.max_iterations if steps is None else steps):
        y = best(factors * system.operator.multiply(x) + rewards, system, direction)
        if factor != 0 and not rounding.signed and may_underflow(x, least):
            y = enclosed([y], partial(_of_signs, system, x, rewards, direction))[-1]
        change, x, taken, remaining = y - x, y, taken + 1, remaining * float(factor)
        if digits is not None:
            digits.is_known(taken, [x], [x])  # refuses numbers that become too large
        if not exact:
            largest = max(largest, _largest(x))
        if steps is None:
            margin = 0.0 if exact else rounding.margin(largest)
            lower, upper = x + later * change.min(), x + later * change.max()
            width = largest_width(lower, upper, options.relative)
        if context.observer is not None:
            context.observer(Progress("step by step", taken, width, system.n))
        if steps is None and (width <= 0.5 * options.epsilon or (upper - lower).max() <= margin):
            break
        if steps is not None and (not change.any() or (not exact and remaining <= negligible)):
            break
    name, about = ("step by step", "") if steps is not None else ("value iteration", "MacQueen")
    context.log.runs.append(
        SolverRun("linear" if steps is None else "steps", name, system.n, taken, about)
    )
    if exact:
        return system.lift(x, None, up_to_rounding=True)
    if steps is None:  # `later` is the same for all states, and so is its error
        return _lifted(context, rounding, (lower, upper), np.full_like(upper, margin))
    return _lifted(context, rounding, (x, x), rounding.margins(x, largest))


def _of_signs(system: System, x: Numbers, rewards: Numbers, direction: Direction | None) -> Numbers:
    """A step with 1 in place of all positive numbers: 0 where its result is 0."""
    return best(system.operator.multiply(np.sign(x)) + np.sign(rewards), system, direction)


def _largest(*values: Numbers) -> float:
    """The largest absolute entry."""
    return max(float(np.abs(v).max(initial=0.0)) for v in values)


@dataclass(frozen=True, eq=False)
class _Rounding:
    """Bounds on the rounding errors of the discount, of products and of the iteration."""

    system: System
    rewards: Numbers
    discount: Fraction
    steps: int | None

    @property
    def signed(self) -> bool:
        """Whether a reward is negative."""
        return bool(self.rewards.min(initial=0.0) < 0)

    @cached_property
    def greatest_reward(self) -> float:
        """The largest absolute reward of a step."""
        return _largest(self.rewards)

    @property
    def relative(self) -> float:
        """The relative error of a step if all its terms have the same sign."""
        return (self.system.operator.longest + 9) * UNIT_ROUNDOFF + self.system.error

    def margin(self, largest: float) -> float:
        """A bound for all states: an error of c max|x| in each step amounts to c max|x| / (1 -
        discount) over all steps.

        Args:
            largest: max|x|, over the steps.
        """
        horizon = 1 / float(1 - self.discount)
        if self.steps is not None:
            horizon = min(horizon, float(self.steps))
        return self.relative * (largest + self.greatest_reward) * horizon

    def margins(self, upper: Numbers, largest: float) -> Floats:
        """A bound for each state. Without negative rewards, what is earned in step i has the
        relative errors of i + 1 steps.

        Args:
            upper: upper bounds on the values.
            largest: as for `margin`.
        """
        absolute = np.full(len(upper), self.margin(largest))
        if self.signed:
            return absolute
        count = _HORIZONS / float(1 - self.discount)
        if self.steps is not None:
            count = min(count, float(self.steps))
        relative = math.expm1(min(count * self.relative, 700.0))
        later = math.exp(-_HORIZONS) * largest
        lost = count * UNDERFLOW_MARGIN
        with np.errstate(over="ignore"):
            return np.asarray(np.minimum(absolute, relative * upper + later) + lost)


def _lifted(
    context: Context, rounding: _Rounding, bounds: tuple[Numbers, Numbers], margins: Floats
) -> Values:
    """Bounds as values, widened by the rounding errors."""
    lower, upper = bounds
    system, relative = rounding.system, context.options.relative
    if rounding.signed:
        low, high = lower - margins, upper + margins
        # Relative to values around 0, rounding errors may be large.
        enough = context.options.epsilon * (_largest(lower, upper) if relative else 1.0)
        wide = (upper - lower > margins) | (high - low > enough)
        width = largest_width(low[wide], high[wide], relative)
    else:  # sums of zeros have no error
        margins = np.where(upper == 0.0, 0.0, margins)
        low, high = np.maximum(lower - margins, 0.0), upper + margins
        width = largest_width(low, high, relative)
    context.warn_if_wide(width, "discounted rewards")
    if largest_width(low, high, relative=True) <= ROUNDING:
        return system.lift(low, high, up_to_rounding=True)
    return system.lift(low, high)
