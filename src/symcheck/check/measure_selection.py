"""Which implementation of the measures serves an engine, by its model type."""

from __future__ import annotations

from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.measures.base import Measures
from symcheck.syntax.ast import ModelType

__all__ = ["measures"]


def measures(context: Context) -> Measures:
    """Who measures on this engine: by the type of its model (imported when first needed)."""
    kind = context.engine.model.type
    match kind:
        case ModelType.DTMC:
            from symcheck.check.measures import dtmc

            return dtmc
        case ModelType.CTMC:
            from symcheck.check.measures import ctmc

            return ctmc
        case ModelType.MDP:
            from symcheck.check.measures import mdp

            return mdp
        case _:
            assert_never(kind)
