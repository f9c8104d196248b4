"""Measures on Markov decision processes: least and greatest values over all strategies."""

from __future__ import annotations

from symcheck.check import discrete
from symcheck.check.context import Context
from symcheck.check.long_run_mdp import steady_probability, steady_reward
from symcheck.check.reach import reach_reward, until
from symcheck.check.reward_bound import counted_next, counted_until
from symcheck.check.total import total_reward
from symcheck.check.window import Window
from symcheck.engines.base import StateSet, Values

__all__ = [
    "bounded_until",
    "counted_next",
    "counted_until",
    "cumulative_reward",
    "instantaneous_reward",
    "next_probability",
    "positive",
    "reach_reward",
    "steady_probability",
    "steady_reward",
    "total_reward",
    "until",
]

next_probability = discrete.next_probability
cumulative_reward = discrete.cumulative_reward
instantaneous_reward = discrete.instantaneous_reward


def bounded_until(context: Context, left: StateSet, right: StateSet, window: Window, direction: str | None) -> Values:
    """Least or greatest probability of left U[a,b] right, in steps; strategies may count the steps."""
    return discrete.bounded_until(context, left, right, window, direction, until)


def positive(context: Context, left: StateSet, right: StateSet, window: Window, direction: str | None) -> StateSet | None:  # noqa: ARG001
    """Left to the numbers: products of positive numbers are positive, and zeros are exact."""
    return None
