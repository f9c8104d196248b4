"""The measures that depend on the model type: those in time, and long-run averages.

Each measure gives a value per reachable state. `direction` is minimise or maximise over the
strategies of an MDP, and None for a chain. Values are certified within `context.options.epsilon`;
values that graph analysis decides are exact.

Raises:
    UnsupportedError: the model type does not have the measure.
    NumericalError: the requested accuracy is not reached.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Protocol

from symcheck.check.context import Context
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = ["LongRunMeasures", "TimedMeasures"]


class TimedMeasures(Protocol):
    """Time-bounded measures: in discrete steps (step_bounded.py) or continuous time (ctmc.py)."""

    def next_probability(
        self, context: Context, target: StateSet, window: Window, direction: Direction | None
    ) -> Values:
        """Probability that the next state is in `target` and is reached within the window."""
        ...

    def bounded_until(
        self,
        context: Context,
        path: UntilPath[StateSet],
        direction: Direction | None,
        unbounded: Callable[[Context], Values],
    ) -> Values:
        """Probability that the path formula, which has bounds, holds.

        `unbounded` computes that probability without a window.
        """
        ...

    def prob_greater_zero(
        self,
        context: Context,
        path: UntilPath[StateSet],
        direction: Direction | None,
        unbounded: Callable[[Context], Values],
    ) -> StateSet | None:
        """States in which the path formula, which has bounds, has a positive
        probability; None: not decided. `unbounded` is as for `bounded_until`.
        """
        ...

    def cumulative_reward(
        self, context: Context, reward: Reward, window: Window, direction: Direction | None
    ) -> Values:
        """Expected reward up to the end of the window."""
        ...

    def instantaneous_reward(
        self, context: Context, reward: Reward, time: Fraction, direction: Direction | None
    ) -> Values:
        """Expected state reward at a time."""
        ...


class LongRunMeasures(Protocol):
    """Long-run averages of chains (long_run.py), and their optima for MDPs (long_run_mdp.py)."""

    def steady_probability(
        self, context: Context, states: StateSet, direction: Direction | None
    ) -> Values:
        """Long-run fraction of the time that is spent in `states`."""
        ...

    def steady_reward(
        self, context: Context, reward: Reward, direction: Direction | None
    ) -> Values:
        """Long-run average of the reward per step or unit of time."""
        ...
