"""Formulas of linear time, by way of automata."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.engines.base import Values
from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import PathFormula

__all__ = ["path_probability_ltl"]


def path_probability_ltl(context: Context, path: PathFormula, direction: str | None) -> Values:  # noqa: ARG001
    """Probability of a formula of linear time at each state."""
    raise UnsupportedError(
        "a path formula with nested temporal operators is not supported yet; X, U, F, G, W and R over state formulas are"
    )
