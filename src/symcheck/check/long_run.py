"""Long-run averages of Markov chains: the stationary distribution of each bottom component, and who gets there."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.engines.base import StateSet, Values
from symcheck.numerics.matrix import Floats

__all__ = ["steady_probability", "steady_reward"]


def steady_probability(context: Context, states: StateSet) -> Values:
    """Long-run share of the time that is spent in `states`, from each state.

    A bottom component has one average for all its states; a state outside has the average of those, weighted with the
    probabilities of getting there. Source: Baier & Katoen (2008), 10.1.2; Baier, Haverkort, Hermanns & Katoen (2003).
    """
    return _average(context, context.engine.system(context.engine.all).restrict(states))


def steady_reward(context: Context, structure: int) -> Values:
    """Long-run average of the reward per step (DTMC) or unit of time (CTMC)."""
    states, rows = context.engine.system(context.engine.all).rewards(structure)
    return _average(context, states + rows)


def _average(context: Context, reward: Floats) -> Values:
    raise NotImplementedError
