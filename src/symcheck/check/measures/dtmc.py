"""Measures on discrete-time Markov chains."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measures import step_bounded
from symcheck.check.measures.long_run import steady_probability, steady_reward
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.check.measures.reward_bounded_until import reward_bounded_next, reward_bounded_until
from symcheck.check.measures.total_reward import total_reward
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.semantics.time_bounds import Window

__all__ = [
    "bounded_until",
    "cumulative_reward",
    "instantaneous_reward",
    "next_probability",
    "prob_greater_zero",
    "reach_reward",
    "reward_bounded_next",
    "reward_bounded_until",
    "steady_probability",
    "steady_reward",
    "total_reward",
    "until",
]

next_probability = step_bounded.next_probability
cumulative_reward = step_bounded.cumulative_reward
instantaneous_reward = step_bounded.instantaneous_reward


def bounded_until(
    context: Context, left: StateSet, right: StateSet, window: Window, direction: Direction | None
) -> Values:
    """Probability of left U[a,b] right, in steps."""
    return step_bounded.bounded_until(context, left, right, window, direction, until)


def prob_greater_zero(
    context: Context, left: StateSet, right: StateSet, window: Window, direction: Direction | None
) -> StateSet | None:
    """Left to the numbers: products of positive numbers are positive, and zeros are exact."""
    return None
