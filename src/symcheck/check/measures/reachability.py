"""Reachability: the states that graph analysis decides, and the equations of the others.

Sources: Baier & Katoen (2008), 10.1.1 and 10.6.1; for rewards, Forejt, Kwiatkowska, Norman & Parker
(2011), 'Automated verification techniques for probabilistic systems', section 4.
"""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.matrices.numbers import Numbers
from symcheck.numerics.underflow import enclosed
from symcheck.semantics.rewards import Reward

__all__ = ["boundary_values", "one_step_bounds", "reach_reward", "until"]


def until(context: Context, left: StateSet, right: StateSet, direction: Direction | None) -> Values:
    """Probability of `left U right` from each state; graph analysis gives 0 and 1 exactly.

    Args:
        context: the engine, the options and the log.
        left: the states that paths may go through.
        right: the states to be reached.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Values in [0, 1], certified within `options.epsilon`.

    Source: Baier & Katoen (2008), 10.1.1 and 10.6.1.
    """
    graph = context.engine.graph
    zero = graph.prob0(left, right, direction)
    one = graph.prob1(left, right, direction)
    system = context.engine.system(~(zero | one), direction)
    return context.solve(system.reachability(one), known=[(one, 1.0)])


def reach_reward(
    context: Context, reward: Reward, target: StateSet, direction: Direction | None
) -> Values:
    """Expected reward until `target` is reached.

    Infinite where `target` is not reached almost surely ('max': under some strategy, 'min': under
    all), and where an infinite reward may be earned before.

    Args:
        context: the engine, the options and the log.
        reward: what is counted.
        target: the states to be reached.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Values of at least 0, certified within `options.epsilon`.

    Raises:
        UnsupportedError: least rewards where some reward of a single step is infinite.

    Source: Forejt et al. (2011), section 4; de Alfaro (1997) for finite least rewards.
    """
    finite = context.engine.finite_reward(reward, target, direction)
    system = context.engine.system(finite - target, direction)
    return context.solve(system.expected_reward(reward, infinite=~finite), known=[])


def boundary_values(context: Context, states: StateSet, outside: Values) -> Values:
    """Expected value of `outside` at the first state that a run visits outside of `states`.

    For chains that leave `states` almost surely.
    """
    system = context.engine.system(states)
    low, high = one_step_bounds(system, outside)
    equations = system.equations(low, None if outside.is_point else high, probability=False)
    return context.solve(equations, known=[]).choose(states, outside)


def one_step_bounds(system: System, values: Values) -> tuple[Numbers, Numbers]:
    """Per row: bounds on the sum over the successors outside of the states of probability × value,
    which are 0 only where graph analysis says so, and not where products underflow.
    """
    low, high = system.one_step_values(values)
    bounds = enclosed(
        [low] if low is high else [low, high],
        lambda: system.one_step_probability(~(values.compare("=", 0)[0] | system.states)),
        signed=values.minimum(system.states | ~system.states)[0] < 0,
    )
    return bounds[0], bounds[-1]
