"""The steady-state operator."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measure_selection import long_run_measures
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values

__all__ = ["steady_values"]


def steady_values(context: Context, states: StateSet, direction: Direction | None) -> Values:
    """Long-run probability of `states`, from each state (of an MDP, the least or the greatest)."""
    if not states:
        return context.engine.constant(0)
    if states == context.engine.all:
        return context.engine.constant(1)
    return long_run_measures(context).steady_probability(context, states, direction)
