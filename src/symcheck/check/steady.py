"""The steady-state operator."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measures import measures
from symcheck.engines.base import StateSet, Values
from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import ModelType

__all__ = ["steady_values"]


def steady_values(context: Context, states: StateSet) -> Values:
    """Long-run probability of being in `states`, from each state. Raises UnsupportedError for an MDP."""
    if context.engine.model.type is ModelType.MDP:
        raise UnsupportedError("S asks about one distribution in the long run, and an mdp has one per strategy; use a dtmc or ctmc")
    if not states:
        return context.engine.constant(0)
    if states == context.engine.all:
        return context.engine.constant(1)
    return measures(context).steady_probability(context, states)
