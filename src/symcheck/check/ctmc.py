"""Measures on continuous-time Markov chains: the embedded chain where time does not matter, uniformisation where it does."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.window import Window
from symcheck.engines.base import StateSet


def positive(context: Context, left: StateSet, right: StateSet, window: Window, direction: str | None) -> StateSet | None:  # noqa: ARG001
    """Where left U[a,b] right has a positive probability: any number of jumps happens within any time, however short."""
    graph = context.engine.graph
    lower, upper = window.times()
    if upper == 0:
        return right
    reaching = graph.exists_until(left, right if upper != lower else left & right)
    return reaching if lower == 0 else reaching & left
