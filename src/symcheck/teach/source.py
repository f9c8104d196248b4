"""What traces accept: a model, or one of the stages that it is built by."""

from __future__ import annotations

from symcheck.dd.cudd_import import available
from symcheck.engines.symbolic.diagrams import set_diagrams_of
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.errors import UsageError
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.build import build, construct
from symcheck.symbolic.checks import check_model
from symcheck.symbolic.model import StateSpace, SymbolicModel, Transitions
from symcheck.symbolic.reachability.search import reach
from symcheck.view.choice_graph import GivenModel

__all__ = [
    "bound_of",
    "diagrams_of",
    "encoded",
    "graph_engine",
    "state_space",
    "symbolic_engine",
    "transitions_of",
]


def _model(source: GivenModel) -> GivenModel:
    """The model itself. Raises UsageError for what is none."""
    if not isinstance(source, GivenModel):
        raise UsageError(f"a model is expected, not {source!r}", hint="symcheck.load reads a file")
    return source


def bound_of(source: GivenModel | BoundModel) -> BoundModel:
    """The bound model."""
    return source if isinstance(source, BoundModel) else _model(source).bound


def encoded(source: GivenModel | SymbolicModel) -> SymbolicModel:
    """The encoded model."""
    if isinstance(source, SymbolicModel):
        return source
    return build(_model(source).bound, source.options)


def state_space(source: GivenModel | StateSpace) -> StateSpace:
    """The reachable states."""
    return source if isinstance(source, StateSpace) else reach(encoded(source))


def transitions_of(source: GivenModel | Transitions) -> Transitions:
    """The matrix as a diagram."""
    if isinstance(source, Transitions):
        return source
    return construct(_model(source).bound, source.options)


def graph_engine(source: GivenModel | SymbolicEngine) -> SymbolicEngine:
    """An engine for questions about the graph of a model: of a chain, it needs no CUDD."""
    if not isinstance(source, GivenModel):
        return source
    if available() or source.bound.type.has_choices:
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

    return MtbddEngine.of(transitions_of(source)) if isinstance(source, GivenModel) else source
