"""Which implementation measures on a model: the only place where measures depend on the model type.

Until probabilities, rewards until a set is reached, total rewards and bounds on rewards are the same for all types.
"""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measures.base import LongRunMeasures, TimedMeasures
from symcheck.syntax.ast import ModelType

__all__ = ["long_run_measures", "timed_measures"]


def timed_measures(context: Context) -> TimedMeasures:
    """Measures within a time, in steps or continuous (imported when first needed)."""
    if context.engine.model.type is ModelType.CTMC:
        from symcheck.check.measures import ctmc

        return ctmc
    from symcheck.check.measures import step_bounded

    return step_bounded


def long_run_measures(context: Context) -> LongRunMeasures:
    """Long-run averages, of a chain or of an MDP (imported when first needed)."""
    if context.engine.model.type is ModelType.MDP:
        from symcheck.check.measures import long_run_mdp

        return long_run_mdp
    from symcheck.check.measures import long_run

    return long_run
