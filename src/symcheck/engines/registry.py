"""The engines by name, and their builders. A new engine is a line in `BUILDERS`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, assert_never, cast

from symcheck.engines import tuning
from symcheck.engines.base import Engine, erased
from symcheck.errors import converts_memory_error
from symcheck.options import EngineName, Options
from symcheck.semantics.binding.probability_sums import normalised_at
from symcheck.semantics.features import Feature, offers, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.state_faults import AlmostOne
from symcheck.syntax.ast import Weights

if TYPE_CHECKING:
    from symcheck.engines.explicit.engine import ExplicitEngine

__all__ = ["BUILDERS", "build", "on_rows"]


Observer = Callable[[object], None]
Builder = Callable[[BoundModel, Options, Observer | None], Engine]


def _auto(model: BoundModel, options: Options, observer: Observer | None) -> Engine:
    from symcheck.engines.selection import choose

    return choose(model, options, observer)


def _explicit(model: BoundModel, options: Options, observer: Observer | None) -> Engine:
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.explicit.build import explore
    from symcheck.semantics.reduction.symmetry import observed_symmetries

    symmetries = observed_symmetries(model)
    explored = explore(model, options, observer, symmetries=symmetries)
    return erased(ExplicitEngine(explored, represented=explored.represented))


def _exact(model: BoundModel, options: Options, _: Observer | None) -> Engine:
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.engines.rational.explore import explore_exactly

    if model.parameters:
        from symcheck.engines.parametric.build import explore_parametric

        return erased(ExplicitEngine(explore_parametric(model, options), "parametric"))
    from symcheck.engines.rational.whole_numbers import explore_in_whole_numbers

    compiled = explore_in_whole_numbers(model, options)
    if compiled is not None:
        return erased(ExplicitEngine(compiled, "exact"))
    explored = explore_exactly(
        model,
        fix_deadlocks=options.fix_deadlocks,
        check_sums=options.check_sums,
        max_memory=options.max_memory,
    )
    return erased(ExplicitEngine(explored, "exact"))


def _symbolic(
    name: EngineName, model: BoundModel, options: Options, observer: Observer | None
) -> Engine:
    """The engine on diagrams; on explicit rows if the diagrams do not compress the states."""
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.engines.symbolic.forms import HybridEngine, MtbddEngine, SparseEngine
    from symcheck.explicit.build import explore
    from symcheck.symbolic.build import build_state_space
    from symcheck.symbolic.matrix.transitions import transitions

    space = build_state_space(model, options, observer)
    nodes, most = space.states.node_count, tuning.MAX_NODES_PER_STATE * space.count
    if nodes > max(tuning.SMALL_DIAGRAM_NODES, most) and space.count <= tuning.EXPLORED_STATES:
        reason = f"{nodes:,} nodes for {space.count:,} states: rows are explored explicitly"
        del space  # frees the memory of the diagrams
        return erased(ExplicitEngine(explore(model, options, observer), f"{name} ({reason})"))
    (kind,) = (k for k in (SparseEngine, HybridEngine, MtbddEngine) if k.name == name)
    return erased(kind.of(transitions(space, options, observer)))


BUILDERS: Mapping[EngineName, Builder] = {
    "auto": _auto,
    "explicit": _explicit,
    "exact": _exact,
    "sparse": partial(_symbolic, "sparse"),
    "hybrid": partial(_symbolic, "hybrid"),
    "mtbdd": partial(_symbolic, "mtbdd"),
}


def _offered(model: BoundModel, name: EngineName) -> EngineName:
    """The engine, or 'explicit' for 'auto' if the class of the model has no diagrams.

    Raises UnsupportedError if the class of the model has no such engine.
    """
    match name:
        case "auto":
            require(model, Feature.ROWS)
            return name if offers(model, Feature.DIAGRAMS) else "explicit"
        case "explicit":
            require(model, Feature.ROWS)
        case "exact":
            require(model, Feature.ROWS, Feature.RATIONALS)
        case "sparse" | "hybrid" | "mtbdd":
            require(model, Feature.DIAGRAMS)
        case _:
            assert_never(name)
    return name


@converts_memory_error()
def build(model: BoundModel, options: Options, observer: Observer | None = None) -> Engine:
    """Build a model on the engine that the options name ('exact' if they ask for rationals).

    Args:
        model: the bound model.
        options: the engine, limits, and the order of the variables.
        observer: receives the events of the builders: progress, iterations, the EngineChoice of
            'auto'.

    Raises:
        UsageError: the order names unknown variables.
        UnsupportedError: a timed automaton has constraints that digital clocks do not take.
        ModelFault: the model has a fault in some state.
        ResourceError: a limit of time or memory was reached.
    """
    name: EngineName = "exact" if options.exact else options.engine
    if model.parameters and name in ("auto", "explicit"):
        name = "exact"
    if model.parameters and name in ("sparse", "hybrid", "mtbdd"):
        from symcheck.engines.parametric.corners import corners

        return build(corners(model, model.parameters), options, observer)
    name = _offered(model, name)
    if name == "auto" and options.workdir is not None:
        from symcheck.engines.selection import EngineChoice

        name = "explicit"
        if observer is not None:
            observer(EngineChoice(name, "its arrays may be in files"))
    if options.order is not None:  # checked even if no diagram is made
        from symcheck.symbolic.ordering.order import check_order

        check_order(model, options.order)
    if model.type.has_clocks:  # its states are those that digital clocks have, or none are listed
        from symcheck.semantics.timed.digital import digital_clocks

        return build(digital_clocks(model), options, observer)
    if model.builder is not None:
        return cast(Engine, model.builder(replace(options, engine=name)))
    if model.weights is Weights.INTERVALS:
        from symcheck.engines.intervals import build_intervals

        inner = replace(options, engine="explicit" if name == "auto" else name)
        return build_intervals(model, inner, lambda m, o: on_rows(build(m, o, observer), o))
    try:
        built = BUILDERS[name](model, options, observer)
        if model.type.players < 2:
            return built
        rows = on_rows(built, options)  # games are solved on rows, which diagrams list
        if model.type.concurrent:
            from symcheck.engines.explicit.joint_rows import require_joint_actions

            require_joint_actions(rows.explored)
        return erased(rows)
    except AlmostOne as fault:
        model = normalised_at(model, fault)
    return build(model, options, observer)


def on_rows(engine: Engine, options: Options) -> ExplicitEngine:
    """The model of an engine on the rows of all states; nothing is explored again.

    The rows of diagrams have the states and the choices in the order of the engine. Only a model
    that is not in the order of its declarations, or was read state by state, is built anew.

    Args:
        engine: the built model.
        options: those that it was built with.

    Raises:
        SymcheckError: see `build`.
    """
    from symcheck.engines.explicit.engine import ExplicitEngine

    explicit = engine.capability(ExplicitEngine)
    if explicit is not None:
        return explicit
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.engines.symbolic.materialized import materialize

    symbolic = engine.capability(SymbolicEngine)
    if symbolic is not None and options.order is None and engine.model.builder is None:
        return replace(materialize(symbolic), name=engine.name)
    explicit = build(engine.model, replace(options, engine="explicit")).capability(ExplicitEngine)
    assert explicit is not None
    return explicit
