"""What can be measured on a model, and who measures it for which type of model."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Protocol

from symcheck.check.context import Context
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Count, Window

__all__ = ["Measures"]


class Measures(Protocol):
    """The measures of one type of model: each gives a value per reachable state.

    `direction` is 'min' or 'max' over the strategies of an MDP, and None otherwise. Accuracy: `context.options.epsilon`, certified; what graph analysis decides is exact. Raises
    UnsupportedError for a measure that the type of model does not have, and NumericalError where the accuracy is missed.
    """

    def next_probability(
        self, context: Context, target: StateSet, window: Window, direction: Direction | None
    ) -> Values:
        """Probability that the next state is in `target` and is reached within the window."""
        ...

    def until(
        self, context: Context, left: StateSet, right: StateSet, direction: Direction | None
    ) -> Values:
        """Probability of left U right."""
        ...

    def bounded_until(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        window: Window,
        direction: Direction | None,
    ) -> Values:
        """Probability of left U right where `right` holds at some time in the window, and `left` before."""
        ...

    def reward_bounded_until(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        counts: Sequence[Count],
        direction: Direction | None,
    ) -> Values:
        """Probability of left U right where the rewards gathered until `right` are within bounds."""
        ...

    def reward_bounded_next(
        self,
        context: Context,
        target: StateSet,
        counts: Sequence[Count],
        direction: Direction | None,
    ) -> Values:
        """Probability that the next state is in `target`, and the rewards of the step are within bounds."""
        ...

    def prob_greater_zero(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        window: Window,
        direction: Direction | None,
    ) -> StateSet | None:
        """Where that probability is greater than 0; None where only numbers tell."""
        ...

    def reach_reward(
        self, context: Context, reward: Reward, target: StateSet, direction: Direction | None
    ) -> Values:
        """Expected reward until `target`; infinite where it is missed with positive probability."""
        ...

    def cumulative_reward(
        self, context: Context, reward: Reward, window: Window, direction: Direction | None
    ) -> Values:
        """Expected reward up to the end of the window."""
        ...

    def total_reward(self, context: Context, reward: Reward, direction: Direction | None) -> Values:
        """Expected reward for ever."""
        ...

    def instantaneous_reward(
        self, context: Context, reward: Reward, time: Fraction, direction: Direction | None
    ) -> Values:
        """Expected state reward at a time."""
        ...

    def steady_probability(
        self, context: Context, states: StateSet, direction: Direction | None
    ) -> Values:
        """Long-run share of the time that is spent in `states`."""
        ...

    def steady_reward(
        self, context: Context, reward: Reward, direction: Direction | None
    ) -> Values:
        """Long-run average of the reward per step or unit of time."""
        ...
