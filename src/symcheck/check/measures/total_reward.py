"""Total expected reward over infinite runs."""

from __future__ import annotations

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward
from symcheck.check.measures.step_bounded import best
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.semantics.rewards import Reward

__all__ = ["total_reward"]


def total_reward(context: Context, reward: Reward, direction: Direction | None) -> Values:
    """Total expected reward from each state, for non-negative rewards.

    In a chain, it is the expected reward until the states from which no reward can be earned; it
    is infinite where these are not reached almost surely. The least one of an MDP is that until the
    end components without reward. The greatest one is infinite where an end component with a reward
    can be reached.

    Raises:
        UnsupportedError: a reward is negative.
    """
    engine = context.engine
    whole = engine.system(engine.all)
    per_step = whole.step_rewards(reward)
    if len(per_step) and per_step.min() < 0:
        raise UnsupportedError("a total reward with negative rewards is not supported; C<=k is")
    if direction is Direction.MAX:
        return _greatest(context, reward, whole, per_step)
    if direction is Direction.MIN:
        return reach_reward(
            context, reward, _reward_free_mecs(context, whole, per_step == 0), direction
        )
    rewarding = engine.from_bools(per_step > 0)
    return reach_reward(context, reward, ~engine.graph.exists_until(engine.all, rewarding), None)


def _reward_free_mecs(context: Context, whole: System, reward_free: Bools) -> StateSet:
    """States in an end component whose rows carry no reward."""
    parts = graph.maximal_end_components(whole.matrix, np.ones(whole.n, bool), reward_free)
    return context.engine.from_bools(parts.of >= 0)


def _greatest(context: Context, reward: Reward, whole: System, per_step: Numbers) -> Values:
    """The greatest total reward; a run may stay in end components without reward, with value 0."""
    engine = context.engine
    parts = graph.maximal_end_components(whole.matrix, np.ones(whole.n, bool))
    paying = engine.from_bools(
        best((parts.rows & (per_step > 0)).astype(np.float64), whole, Direction.MAX) > 0
    )
    infinite = engine.graph.exists_until(engine.all, paying)
    rewarding = engine.from_bools(best(per_step, whole, Direction.MAX) > 0)
    nothing = ~engine.graph.exists_until(engine.all, rewarding)
    system = engine.system(~(infinite | nothing), Direction.MAX)
    equations = system.equations(system.step_rewards(reward), probability=False, allow_stay=True)
    return context.solve(equations, known=[(infinite, np.inf)])
