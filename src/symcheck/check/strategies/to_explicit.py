"""The same model with its states and rows listed, for what needs rows."""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.registry import build

__all__ = ["listed"]


def listed(context: Context) -> Context:
    """The context, over the explicit engine where it has another one in floating point (the model is then explored again)."""
    if context.engine.capability(ExplicitEngine) is not None:
        return context
    return replace(
        context,
        engine=build(context.engine.model, replace(context.options, engine="explicit")),
        relevant_states=None,
    )
