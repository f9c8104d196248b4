"""Rewards earned within a cost: `R{"r"}=? [ C{"c"}<=k ]`, the reward until the cost would exceed k.

A step is counted if the cost up to and including it is at most k, as C<=k counts k steps.
"""

from __future__ import annotations

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reward_bounded_until import row_rewards
from symcheck.check.measures.reward_scaling import scale_bound
from symcheck.check.measures.step_bounded import lift_bounds
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import Values
from symcheck.errors import UnsupportedError
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import RewardWindow

__all__ = ["cost_bounded_reward"]


def cost_bounded_reward(
    context: Context, reward: Reward, count: RewardWindow, direction: Direction | None
) -> Values:
    """Expected reward of the steps before the one with which a cost exceeds its bound.

    Args:
        context: the engine, the options and the log.
        reward: what is earned; not negative.
        count: the cost and its upper bound; costs are non-negative multiples of a common step, and
            those of a CTMC belong to transitions.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Certified values; infinite where a cycle without cost earns a reward.

    Raises:
        UnsupportedError: the bound has no upper limit, or rewards or costs are of another kind.
        MemoryLimitError: the levels of the budget do not fit into memory.
    """
    from symcheck.numerics.reward_bounds.cost_bounded import CostBoundedProblem, solve_cost_bounded

    engine, window = context.engine, count.window
    if window.upper is None or window.lower or window.lower_strict:
        raise UnsupportedError('a cumulative reward has an upper bound only: C{"c"}<=k')
    system = engine.system(engine.all)
    bound = scale_bound(context, system, row_rewards(context, system, count), count)
    if bound.upper is None or bound.empty:
        return engine.constant(0)
    rewards, matrix = system.step_rewards(reward), system.matrix
    if len(rewards) and (rewards.min() < 0 or rewards.max() == np.inf):
        raise UnsupportedError(
            "rewards within a cost must not be negative or infinite; C<=k takes negative ones"
        )
    error = system.error
    problem = CostBoundedProblem(matrix, rewards, bound.rewards, bound.upper, direction, error)
    lower, upper, levels = solve_cost_bounded(problem, context.options, context.observer)
    context.log.runs.append(
        SolverRun("epochs", "budget by budget", system.n, levels, f"{levels} levels of the budget")
    )
    step = (matrix.longest + 5) * UNIT_ROUNDOFF + system.error
    rounding = 1.01 * (levels * step + system.reward_error(reward))
    return lift_bounds(context, system, (lower, upper), rounding, explanation="budget by budget")
