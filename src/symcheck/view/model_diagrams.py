"""The diagrams of a model: built from its commands, or from the states that it was read by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from symcheck.view.choice_graph import GivenModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.symbolic.model import StateSpace, SymbolicModel

__all__ = ["encoded_model", "matrices_of", "read_engine", "space_of"]


def read_engine(model: GivenModel) -> SymbolicEngine | None:
    """The diagrams of a model without commands, such as one of a matrix; None if it has commands.

    Raises UnsupportedError if it has none.
    """
    from symcheck.engines.registry import build
    from symcheck.engines.symbolic.engine import SymbolicEngine

    if model.bound.builder is None:
        return None
    engine = build(model.bound, replace(model.options, engine="mtbdd", exact=False))
    return engine.capability(SymbolicEngine)


def encoded_model(model: GivenModel) -> SymbolicModel:
    """The initial states and the transition relations; guards and updates, if it has commands."""
    from symcheck.symbolic.build import build

    read = read_engine(model)
    return build(model.bound, model.options) if read is None else read.space.symbolic


def space_of(model: GivenModel) -> StateSpace:
    """The reachable states."""
    from symcheck.symbolic.reachability.search import reach

    read = read_engine(model)
    return reach(encoded_model(model)) if read is None else read.space


def matrices_of(model: GivenModel) -> tuple[StateSpace, Sequence[Mtbdd]]:
    """The reachable states; the matrix of a chain, or one matrix per choice class of an MDP."""
    from symcheck.symbolic.build import construct

    read = read_engine(model)
    if read is not None:
        return read.space, read.diagrams.roots
    made = construct(model.bound, model.options)
    return made.space, made.roots
