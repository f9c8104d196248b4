"""What traces accept: a model, or one of the stages that it is built by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from symcheck.dd.cudd_import import available
from symcheck.direction import Direction
from symcheck.engines.base import Engine
from symcheck.engines.symbolic.diagrams import set_diagrams_of
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.errors import UnsupportedError, UsageError
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.build import construct
from symcheck.symbolic.checks import check_model
from symcheck.symbolic.model import StateSpace, SymbolicModel, Transitions
from symcheck.view.choice_graph import GivenModel
from symcheck.view.model_diagrams import encoded_model, matrices_of, read_engine, space_of

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = [
    "bound_of",
    "diagrams_of",
    "direction_of",
    "encoded",
    "graph_engine",
    "matrices",
    "state_space",
    "symbolic_engine",
]


def _model(source: GivenModel) -> GivenModel:
    """The model itself. Raises UsageError for what is none."""
    if not isinstance(source, GivenModel):
        raise UsageError(f"a model is expected, not {source!r}", hint="symcheck.load reads a file")
    return source


def bound_of(source: GivenModel | BoundModel) -> BoundModel:
    """The bound model, which has commands. Raises UnsupportedError."""
    bound = source if isinstance(source, BoundModel) else _model(source).bound
    if bound.builder is not None:
        raise UnsupportedError("a model that was read state by state has no commands to be encoded")
    return bound


def direction_of(
    engine: Engine | SymbolicEngine, given: Direction | str | None
) -> Direction | None:
    """What is done over the strategies of a model: None for a chain, which has none.

    Raises UsageError if an MDP has no direction, or it is no direction.
    """
    hint = "direction='min' takes the least value over the strategies, direction='max' the greatest"
    if given is None:
        if engine.model.type.has_choices:
            raise UsageError("the value depends on the strategy: give a direction", hint=hint)
        return None
    try:
        return Direction(given)
    except ValueError:
        raise UsageError(f"direction={given!r}: expected min or max", hint=hint) from None


def encoded(source: GivenModel | SymbolicModel) -> SymbolicModel:
    """The encoded model."""
    if isinstance(source, SymbolicModel):
        return source
    return encoded_model(_model(source))


def state_space(source: GivenModel | StateSpace) -> StateSpace:
    """The reachable states."""
    return source if isinstance(source, StateSpace) else space_of(_model(source))


def matrices(source: GivenModel | Transitions) -> tuple[StateSpace, Sequence[Mtbdd]]:
    """The reachable states, and the matrix as a diagram, or one per choice class."""
    if isinstance(source, Transitions):
        return source.space, source.roots
    return matrices_of(_model(source))


def graph_engine(source: GivenModel | SymbolicEngine) -> SymbolicEngine:
    """An engine for questions about the graph of a model: of a chain, it needs no CUDD."""
    if not isinstance(source, GivenModel):
        return source
    if available() or source.bound.type.has_choices or source.bound.builder is not None:
        return symbolic_engine(source)
    from symcheck.engines.symbolic.forms import MtbddEngine

    space = state_space(source)
    check_model(space, source.options)
    return MtbddEngine(set_diagrams_of(space), space)


def diagrams_of(source: GivenModel) -> tuple[StateSpace, SymbolicEngine | None]:
    """The reachable states, and an engine for questions about the graph: an MDP without CUDD has
    none.
    """
    if source.bound.type.has_choices and not available():
        return state_space(source), None
    engine = graph_engine(source)
    return engine.space, engine


def symbolic_engine(source: GivenModel | SymbolicEngine) -> SymbolicEngine:
    """An engine with diagrams."""
    from symcheck.engines.symbolic.forms import MtbddEngine

    if not isinstance(source, GivenModel):
        return source
    read = read_engine(source)
    return MtbddEngine.of(construct(source.bound, source.options)) if read is None else read
