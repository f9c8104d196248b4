"""Selection of the implementation of a measure: the only place that depends on the model type.

Until probabilities, reachability rewards, total rewards and reward bounds are the same for all
model types.
"""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measures.base import LongRunMeasures, TimedMeasures
from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import Weights

__all__ = ["long_run_measures", "timed_measures"]


def timed_measures(context: Context) -> TimedMeasures:
    """Time-bounded measures, in steps or continuous time; the module is imported when needed."""
    if context.engine.model.type.immediate_choices:
        from symcheck.check.measures import markov_automata

        return markov_automata
    if context.engine.model.type.continuous_time:
        from symcheck.check.measures import ctmc

        return ctmc
    if context.engine.model.weights is Weights.INTERVALS:
        from symcheck.check.measures import interval_steps

        return interval_steps
    from symcheck.check.measures import step_bounded

    return step_bounded


def long_run_measures(context: Context) -> LongRunMeasures:
    """Long-run averages of a chain or of an MDP; the module is imported when needed.

    Raises:
        UnsupportedError: probabilities are intervals.
    """
    if context.engine.model.weights is Weights.INTERVALS:
        raise UnsupportedError(
            "long-run averages are not available for models with intervals of probabilities",
            hint="they are if all intervals are points",
        )
    if context.engine.model.type.has_choices:
        from symcheck.check.measures import long_run_mdp

        return long_run_mdp
    from symcheck.check.measures import long_run

    return long_run
