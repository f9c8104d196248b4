"""Total expected reward over infinite runs."""

from __future__ import annotations

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward
from symcheck.check.measures.step_bounded import best
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.semantics.rewards import Reward

__all__ = ["GreatestTotal", "greatest_total", "reward_free_mecs", "total_per_step", "total_reward"]


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
    whole, per_step = total_per_step(context, reward)
    if direction is Direction.MAX:
        parts = greatest_total(context, whole, per_step)
        system = engine.system(parts.unknown, Direction.MAX)
        equations = system.equations(
            system.step_rewards(reward),
            probability=False,
            allow_stay=True,
            infinite=parts.infinite,
            constant_error=system.reward_error(reward),
        )
        return context.solve(equations, known=[])
    if direction is Direction.MIN:
        target = engine.from_bools(reward_free_mecs(whole, per_step).of >= 0)
        return reach_reward(context, reward, target, direction)
    rewarding = engine.from_bools(per_step > 0)
    return reach_reward(context, reward, ~engine.graph.exists_until(engine.all, rewarding), None)


def total_per_step(context: Context, reward: Reward) -> tuple[System, Numbers]:
    """The equations over all states, and the reward of each row.

    Raises UnsupportedError: a reward is negative.
    """
    whole = context.engine.system(context.engine.all)
    per_step = whole.step_rewards(reward)
    if len(per_step) and per_step.min() < 0:
        raise UnsupportedError("a total reward with negative rewards is not supported; C<=k is")
    return whole, per_step


def reward_free_mecs(whole: System, per_step: Numbers) -> graph.EndComponents:
    """The maximal end components among the rows without reward."""
    return graph.maximal_end_components(whole.matrix, np.ones(whole.n, bool), per_step == 0)


@dataclass(frozen=True, eq=False)
class GreatestTotal:
    """Where the greatest total reward of an MDP is infinite, and where it is unknown.

    Attributes:
        paying: rows with a reward that stay inside a maximal end component, bool[rows].
        collecting: the states of the components with such rows, bool[n].
        infinite: the states that can reach these.
        unknown: the states that can earn a finite reward.
    """

    paying: Bools
    collecting: Bools
    infinite: StateSet
    unknown: StateSet


def greatest_total(context: Context, whole: System, per_step: Numbers) -> GreatestTotal:
    """Find the states of infinite greatest total reward; those of finite one are to be solved.

    A run may stay in end components without reward, with value 0.
    """
    engine = context.engine
    parts = graph.maximal_end_components(whole.matrix, np.ones(whole.n, bool))
    paying = np.asarray(parts.rows & (per_step > 0), np.bool_)
    owners = _somewhere(paying, whole)
    infinite = engine.graph.exists_until(engine.all, engine.from_bools(owners))
    rewarding = engine.from_bools(_somewhere(np.asarray(per_step > 0, np.bool_), whole))
    nothing = ~engine.graph.exists_until(engine.all, rewarding)
    return GreatestTotal(paying, parts.meeting([owners]), infinite, ~(infinite | nothing))


def _somewhere(rows: Bools, whole: System) -> Bools:
    """The states with one of these rows."""
    return np.asarray(best(rows.astype(np.float64), whole, Direction.MAX) > 0)
