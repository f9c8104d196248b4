"""The explicit engine for a model of another engine, for algorithms that need rows."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.registry import build

__all__ = ["to_explicit"]


def to_explicit(context: Context) -> Context:
    """The context with an explicit engine; the model is explored again if it has another engine."""
    if context.engine.capability(ExplicitEngine) is not None:
        return context
    return replace(
        context,
        engine=build(context.engine.model, replace(context.options, engine="explicit")),
        relevant_states=None,
    )
