"""Time-bounded measures of continuous-time Markov chains, by uniformisation.

Source: Baier, Haverkort, Hermanns & Katoen (2003), 'Model-checking algorithms for continuous-time
Markov chains'.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.signed_steps import REWARD_ERROR
from symcheck.check.measures.step_bounded import lift_bounds, relative_error
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Floats
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.numerics.underflow import enclosed
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.operators import Operator

__all__ = [
    "bounded_until",
    "cumulative_reward",
    "instantaneous_reward",
    "next_probability",
    "one_jump_error",
    "prob_greater_zero",
]

_ENTRY_ROUNDING = 4.0 * UNIT_ROUNDOFF
"""More than the quotient that is a probability and its product with an exit rate are rounded: the
solution is linear in the rewards, so that their relative error is its own.
"""

_TINY = 1e-299
"""Bounds may be this far apart even relative to smaller values, which are close to underflow."""


def next_probability(
    context: Context, target: StateSet, window: Window, direction: Direction | None
) -> Values:
    """Probability that the first jump leads into `target` and happens within the window.

    The time of the jump is exponentially distributed with the exit rate, independently of the
    successor.
    """
    engine = context.engine
    lower, upper = window.times()
    if lower == upper:  # a jump at this very time
        return engine.constant(0)
    system = engine.system(engine.all)
    rates, value = _exit_rates(system), system.one_step_probability(target)
    context.log.runs.append(SolverRun("transient", "one jump", system.n, 1))
    certain, impossible = engine.graph.all_successors_in(target), ~engine.graph.predecessors(target)
    if window.is_unbounded:
        one_jump = lift_bounds(context, system, [value], system.error, explanation="one jump")
        return one_jump.choose(~(certain | impossible), engine.indicator(certain))
    _refuse_rationals(context)
    in_time = np.exp(-rates * lower) * (
        1.0 if upper is None else -np.expm1(-rates * (upper - lower))
    )
    an_instant = window.lower == window.upper
    within = enclosed([value * in_time], lambda: value * (not an_instant))
    exponent = float(np.max(rates, initial=0.0)) * (lower if upper is None else max(lower, upper))
    error = one_jump_error(system, exponent)
    values = lift_bounds(context, system, within, error, explanation="one jump")
    return values.choose(~impossible, engine.constant(0))


def one_jump_error(system: System, exponent: float) -> float:
    """The relative error of the probability of a jump within a time.

    That of exp(-rate t), and of 1 - exp(-rate t), is at most rate t times that of the rate, which
    the probability of a jump so late outweighs below the range of doubles.

    exponent: the largest rate t.
    """
    return 0.5 * ROUNDING + system.error * (2.0 + 4.0 * min(exponent, 750.0))


def bounded_until(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> Values:
    """Probability of `left U[a,b] right`, or of its complement if the path is negative.

    Runs stay in `left` up to time a and satisfy `left U<=b-a right` from then on; `unbounded`
    computes the probability of the latter if there is no b. For the complement, runs that leave
    `left` before time a count.
    """
    lower, upper = path.window.times()
    if lower == 0:
        return unbounded(context) if upper is None else _within(context, path, upper, unbounded)
    # The values at time a are needed at all states that may be reached by then; the two
    # computations share the error.
    context = context.with_epsilon(context.options.epsilon / 3)
    everywhere = replace(context, relevant_states=None)
    later = (
        unbounded(everywhere)
        if upper is None
        else _within(everywhere, path, upper - lower, unbounded)
    )
    return _delayed(context, path.left, later, lower, float(path.negative))


def prob_greater_zero(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> StateSet | None:
    """States where `left U[a,b] right` (or its complement) has positive probability, by the graph.

    Any number of jumps has a positive probability within any positive time, and so has staying.
    """
    graph, left, right = context.engine.graph, path.left, path.right
    lower, upper = path.window.times()
    if path.negative:
        if upper is None:
            return None
        # It fails if the state at time a and no other is seen until b, unless that is in `right`.
        always = left & right if lower > 0 else right
        return graph.exists_until(context.engine.all, ~always) if lower > 0 else ~always
    if upper == 0:
        return right
    reaching = graph.exists_until(left, right if upper != lower else left & right)
    return reaching if lower == 0 else reaching & left


def cumulative_reward(
    context: Context, reward: Reward, window: Window, direction: Direction | None
) -> Values:
    """Expected reward up to time t: state rewards per unit of time, transition rewards per jump."""
    _, time = window.times()
    assert time is not None
    if time == 0:
        return context.engine.constant(0)
    system = context.engine.system(context.engine.all)
    error = system.earned_error(reward)
    return _sum_of_signs(context, None, system.earned(reward), time, error)


def instantaneous_reward(
    context: Context, reward: Reward, time: Fraction, direction: Direction | None
) -> Values:
    """Expected state reward at time t."""
    system = context.engine.system(context.engine.all)
    states = system.state_rewards(reward)
    error = system.state_reward_error(reward)
    if time == 0:
        return lift_bounds(context, system, [states], error)
    return _sum_of_signs(context, states, None, float(time), error)


def _refuse_rationals(context: Context) -> None:
    if context.engine.is_rational:
        raise UnsupportedError(
            "time-bounded properties of a CTMC have no rational values",
            hint="check them without -exact",
        )


def _within(
    context: Context, path: UntilPath[StateSet], time: float, unbounded: Callable[[Context], Values]
) -> Values:
    """Probability of `left U<=t right`, or of its complement, which `unbounded` computes for t
    without end.
    """
    engine = context.engine
    possible = engine.graph.exists_until(path.left, path.right)
    goal = ~possible if path.negative else path.right
    if time == 0:
        return engine.indicator(~path.right if path.negative else path.right)
    system = engine.system((path.left - path.right) & possible)
    end = np.ones(system.n) if path.negative else None

    def limit() -> Floats:
        _, most = unbounded(replace(context, relevant_states=None)).at(system.states)
        return np.minimum(most, 1.0)

    lower, upper = _transient_bounds(
        context,
        system,
        time,
        terminal=end,
        entered=goal,
        limit=None if path.negative else limit,
    )
    return system.lift(np.minimum(lower, 1.0), np.minimum(upper, 1.0), [(goal, 1.0)])


def _delayed(
    context: Context, left: StateSet, values: Values, time: float, outside: float
) -> Values:
    """Expected value at time t over runs that stay in `left` until then; `outside` for others."""
    system = context.engine.system(left)
    low, high = values.at(left)
    entered = ~left if outside else None
    lower, upper = _transient_bounds(context, system, time, terminal=low, entered=entered)
    error = relative_error((low, high))
    if error is None:
        _, upper = _transient_bounds(context, system, time, terminal=high, entered=entered)
    else:
        upper = upper * (1.0 + error)
    return system.lift(lower, upper, [(~left, outside)])


def _sum_of_signs(
    context: Context,
    terminal: Floats | None,
    reward_rate: Floats | None,
    time: float,
    error: float,
) -> Values:
    """Transient values for rewards of both signs: the difference of two non-negative solutions.

    Each is computed over the states that can reach rewards of its sign. error: of the rewards.
    """
    _refuse_rationals(context)
    engine = context.engine
    start = terminal if terminal is not None else reward_rate
    assert start is not None
    signed = bool(np.any(start < 0))
    parts = []
    for sign in (1.0, -1.0):
        positive_part = np.maximum(sign * start, 0.0)
        system = engine.system(
            engine.graph.exists_until(engine.all, engine.from_bools(positive_part > 0))
        )
        rewards = positive_part[engine.to_bools(system.states)]
        lower, upper = _transient_bounds(
            context,
            system,
            time,
            terminal=None if terminal is None else rewards,
            reward_rate=None if reward_rate is None else rewards,
        )
        if signed:
            error = max(error, REWARD_ERROR)
        lower, upper = lower * (1.0 - error), upper * (1.0 + error)
        parts.append(system.lift(lower, upper))
    if not signed:
        return parts[0]
    difference = parts[0].map(Operator.MINUS, parts[1])
    bounds = difference.at(context.relevant_states or engine.all)
    width = largest_width(*bounds, context.options.relative)
    context.warn_if_wide(width, "positive and negative rewards cancel")
    return difference


def _transient_bounds(
    context: Context,
    system: System,
    time: float,
    *,
    terminal: Floats | None = None,
    reward_rate: Floats | None = None,
    entered: StateSet | None = None,
    limit: Callable[[], Floats] | None = None,
) -> tuple[Floats, Floats]:
    """Bounds on x(time) for x' = Q x + reward_rate, x(0) = terminal, over the states of the system.

    entered: states outside, each entry of which is rewarded with 1, instead of `reward_rate`.
    limit: computes an upper bound on the values at any time.

    Returns:
        The lower and the upper bounds, float64[n] each.
    """
    from symcheck.numerics.transient.values import transient_values

    _refuse_rationals(context)
    if system.n == 0:
        return np.empty(0), np.empty(0)
    exit_rates = _exit_rates(system)
    steps = float(exit_rates.max()) * time
    few_rows = system.has_rows and (
        system.n <= tuning.TRANSIENT_ROWS_STATES or steps >= tuning.KRYLOV_STEPS
    )
    has_rows = context.engine.has_rows or few_rows
    if entered is not None:
        reward_rate = exit_rates * system.one_step_probability(entered)
    interest = None
    if context.relevant_states is not None:
        interest = np.flatnonzero(system.restrict(context.relevant_states))
    transient = transient_values(
        system.row_kernel if has_rows else system.kernel,
        time,
        context.options,
        terminal=terminal,
        reward_rate=reward_rate,
        interest=interest,
        observer=context.observer,
        leave=system.one_step_probability(~system.states),
        limit=limit,
        error=system.entry_error,
        trimmed=context.trimmed,
    )
    context.log.runs.append(
        SolverRun(
            "transient",
            "uniformisation",
            system.n,
            transient.iterations,
            transient.explanation,
        )
    )
    error = 0.0 if entered is None else _ENTRY_ROUNDING + system.error
    bounds = transient.lower * (1.0 - error), transient.upper * (1.0 + error)
    relevant = slice(None) if interest is None else interest
    lower, upper = (bound[relevant] for bound in bounds)
    width = largest_width(lower, np.maximum(lower, upper - _TINY), context.options.relative)
    context.warn_if_wide(width, transient.explanation)
    return bounds


def _exit_rates(system: System) -> Floats:
    rates = system.exit_rates
    assert rates is not None, "a model of continuous time"
    return rates
