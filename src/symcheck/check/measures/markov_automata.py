"""Time-bounded measures of Markov automata.

Choices take no time, so a strategy may choose by the time that has passed. Runs that make
infinitely many of them in no time reach later times never.

Source: Guck, Hatefi, Hermanns, Katoen & Timmer (2014), 'Analysis of timed and long-run objectives
for Markov automata'.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.ctmc import one_jump_error
from symcheck.check.measures.step_bounded import best, lift_bounds
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Floats
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.underflow import enclosed
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = [
    "bounded_until",
    "cumulative_reward",
    "instantaneous_reward",
    "next_probability",
    "prob_greater_zero",
    "refuse_zeno",
]

_TINY = 1e-299
"""Bounds may be this far apart even relative to smaller values, which are close to underflow."""


def next_probability(
    context: Context, target: StateSet, window: Window, direction: Direction | None
) -> Values:
    """Probability that the first step leads into `target` and happens within the window."""
    engine = context.engine
    lower, upper = _times(window)
    system = engine.system(engine.all, direction)
    rates, value = _exit_rates(system), system.one_step_probability(target)
    if window.is_unbounded:
        certain = engine.graph.all_successors_in(target)
        impossible = ~engine.graph.predecessors(target)
        bounds = [best(value, system, direction)]
        found = lift_bounds(context, system, bounds, system.error, explanation="one step")
        return found.choose(~(certain | impossible), engine.indicator(certain))
    _refuse_rationals(context)
    timed = rates > 0
    until = 1.0 if upper is None else -np.expm1(-rates * (upper - lower))
    in_time = np.where(timed, np.exp(-rates * lower) * until, float(lower == 0))
    within = best(value * in_time, system, direction)
    bounds = enclosed([within], lambda: best(value * (in_time > 0), system, direction))
    exponent = float(np.max(rates, initial=0.0)) * (lower if upper is None else max(lower, upper))
    error = one_jump_error(system, exponent)
    return lift_bounds(context, system, bounds, error, explanation="one step")


def bounded_until(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> Values:
    """Probability of `left U[a,b] right`, or of its complement if the path is negative.

    As for CTMCs, runs stay in `left` up to time a and satisfy `left U<=b-a right` from then on.
    """
    lower, upper = _times(path.window)
    if lower == 0:
        return unbounded(context) if upper is None else _within(context, path, upper, direction)
    context = context.with_epsilon(context.options.epsilon / 3)
    everywhere = replace(context, relevant_states=None)
    later = (
        unbounded(everywhere)
        if upper is None
        else _within(everywhere, path, upper - lower, direction)
    )
    outside, left = float(path.negative), path.left
    if not path.negative:  # elsewhere the value is 0
        zero, _ = later.compare("<=", 0)
        left = left - context.engine.graph.prob0(left, ~zero, direction)
    system = context.engine.system(left, direction)
    low, high = later.at(left)
    lost = outside * system.one_step_probability(~path.left)
    return _lifted(
        context,
        system,
        direction,
        lower,
        lost,
        (low, high),
        [(~path.left, outside)],
        instant=outside,
    )


def prob_greater_zero(
    context: Context,
    path: UntilPath[StateSet],
    direction: Direction | None,
    unbounded: Callable[[Context], Values],
) -> StateSet | None:
    """States where `left U<=b right` has positive probability; None: not decided by the graph.

    Each number of steps has a positive probability within any positive time.
    """
    lower, upper = _times(path.window)
    if path.negative or lower > 0 or upper == 0:
        return None
    return ~context.engine.graph.prob0(path.left, path.right, direction)


def cumulative_reward(
    context: Context, reward: Reward, window: Window, direction: Direction | None
) -> Values:
    """Expected reward up to time t: state rewards per unit of time, others per step."""
    _, time = window.times()
    assert time is not None
    system = context.engine.system(context.engine.all, direction)
    rewards = system.step_rewards(reward)
    _refuse_signs(rewards)
    refuse_zeno(context, system, "rewards up to a time")
    nothing = system.full(0)
    return _lifted(
        context,
        system,
        direction,
        time,
        rewards,
        (nothing, nothing),
        [],
        greatest=np.inf,
        error=system.reward_error(reward),
    )


def instantaneous_reward(
    context: Context, reward: Reward, time: Fraction, direction: Direction | None
) -> Values:
    """Expected state reward at time t, after the choices that take no time then."""
    system = context.engine.system(context.engine.all, direction)
    states = system.state_rewards(reward)
    _refuse_signs(states)
    refuse_zeno(context, system, "rewards at a time")
    error = system.state_reward_error(reward)
    greatest = float(states.max(initial=0)) * (1.0 + error)
    nothing = np.zeros(system.rows)
    return _lifted(
        context,
        system,
        direction,
        float(time),
        nothing,
        (states, states),
        [],
        greatest=greatest,
        error=error,
    )


def refuse_zeno(context: Context, system: System, what: str) -> None:
    """Refuse a model in which infinitely many steps may take no time, with an example.

    Raises:
        UnsupportedError: a strategy can go through a cycle in which no time passes.
    """
    rates = _exit_rates(system)
    assert system.groups is not None
    cycles = graph.maximal_end_components(system.weights, rates[system.groups[:-1]] == 0)
    if cycles.count:
        members = np.zeros(context.engine.states, np.bool_)
        members[context.engine.to_bools(system.states)] = cycles.of >= 0
        state = context.example(context.engine.from_bools(members))
        raise UnsupportedError(
            f"{what} are not defined where infinitely many steps may take no time, for example "
            f"from state {state}",
            hint="let time pass in each cycle, or remove the choices that stay in it",
        )


def _times(window: Window) -> tuple[float, float | None]:
    """The window; at time 0, choices that take no time make strictness matter."""
    lower, upper = window.times()
    if (lower == 0 and window.lower_strict) or (upper == 0 and window.upper_strict):
        raise UnsupportedError("a strict bound at time 0 is not supported for Markov automata")
    return lower, upper


def _exit_rates(system: System) -> Floats:
    rates = system.exit_rates
    assert rates is not None, "time is continuous"
    return rates


def _refuse_rationals(context: Context) -> None:
    if context.engine.is_rational:
        raise UnsupportedError(
            "time-bounded properties of Markov automata have no rational values",
            hint="check them without -exact",
        )


def _refuse_signs(rewards: Floats) -> None:
    if rewards.min(initial=0) < 0 or not np.isfinite(rewards.astype(np.float64)).all():
        raise UnsupportedError(
            "time-bounded properties of Markov automata with negative or infinite rewards are not "
            "supported"
        )


def _within(
    context: Context, path: UntilPath[StateSet], time: float, direction: Direction | None
) -> Values:
    """Probability of `left U<=t right`, or of its complement."""
    assert direction is not None
    engine = context.engine
    other = direction.dual if path.negative else direction
    whole = engine.system(engine.all)
    assert whole.groups is not None
    instants = engine.from_bools(_exit_rates(whole)[whole.groups[:-1]] == 0)
    left = path.left if time > 0 else path.left & instants
    never = engine.graph.prob0(left, path.right, other)
    at_once = engine.graph.prob1(path.left & instants, path.right, other)
    goal, end = (never, 1.0) if path.negative else (at_once, 0.0)
    system = engine.system(left - at_once - never, direction)
    entered = system.one_step_probability(goal)
    terminal = system.full(0) + end
    return _lifted(
        context, system, direction, time, entered, (terminal, terminal), [(goal, 1.0)], instant=end
    )


def _lifted(
    context: Context,
    system: System,
    direction: Direction | None,
    time: float,
    constant: Floats,
    terminal: tuple[Floats, Floats],
    rest: list[tuple[StateSet, float]],
    *,
    instant: float = 0.0,
    greatest: float = 1.0,
    error: float = 0.0,
) -> Values:
    """The solution over the states of a system, with constants on other sets; see
    `TimedProblem`. A last choice that takes no time may be made at the end. error: of the rewards,
    relative.
    """
    from symcheck.numerics.transient.timed_choices import TimedProblem, timed_values

    _refuse_rationals(context)
    assert direction is not None
    if not system.states:
        return system.lift(system.full(0), None, rest)
    problem = TimedProblem(
        system.matrix,
        _exit_rates(system),
        constant,
        system.one_step_probability(~system.states),
        *terminal,
        direction,
        instant,
        greatest,
        system.error,
    )
    interest = None
    if context.relevant_states is not None:
        interest = np.flatnonzero(system.restrict(context.relevant_states))
    found = timed_values(problem, time, context.options, interest, context.observer)
    run = SolverRun("transient", "uniformisation", system.n, found.iterations, found.explanation)
    context.log.runs.append(run)
    lower, upper = found.lower * (1.0 - error), found.upper * (1.0 + error)
    lower, upper = np.minimum(lower, greatest), np.minimum(upper, greatest)
    part = slice(None) if interest is None else interest
    low, high = lower[part], upper[part]
    width = largest_width(low, np.maximum(low, high - _TINY), context.options.relative)
    context.warn_if_wide(width, found.explanation)
    return system.lift(lower, upper, rest)
