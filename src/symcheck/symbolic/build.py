"""Building: a bound model becomes guards, updates and relations; with `construct`, everything an engine needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from symcheck.errors import told_in_memory
from symcheck.semantics.model import BoundModel
from symcheck.semantics.settings import BuildSettings
from symcheck.symbolic.commands import encode_event
from symcheck.symbolic.encode import encode
from symcheck.symbolic.model import EncodedEvent, StateSpace, SymbolicModel, Transitions
from symcheck.symbolic.order import variable_order
from symcheck.symbolic.reach import reach
from symcheck.symbolic.relations import group_relations
from symcheck.symbolic.translate import Limits, Translator

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["Observer", "build", "construct", "explored", "initial_states"]

Observer = Callable[[object], None]


@told_in_memory()
def build(
    model: BoundModel,
    options: BuildSettings,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
    manager: DiagramManager | None = None,
    limits: Limits | None = None,
) -> SymbolicModel:
    """Encode a model: bits, guards, updates, relations. Reachability and matrices come after (`reach`, `transitions`).

    `observer` gets each EncodedEvent as it is made. `order`: names of variables from the top of the diagrams down;
    by default what the options say.
    `manager`: a fresh diagram manager to build in. Raises UnsupportedError for unbounded integers, ResourceError at a limit.
    """
    if manager is None:
        from symcheck.dd.manager import DiagramManager

        manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    encoding = encode(model, order or variable_order(model, options.order))
    manager.add_variables(encoding.bits)
    translator = Translator(manager, encoding, limits)
    events: list[EncodedEvent] = []
    for event in model.events:
        encoded = encode_event(translator, event)
        events.append(encoded)
        if observer is not None:
            observer(encoded)
    initial = initial_states(model, translator)
    return SymbolicModel(model, manager, encoding, translator, initial, tuple(events), group_relations(manager, encoding, events))


def construct(
    model: BoundModel, options: BuildSettings, observer: Observer | None = None, *, order: Sequence[str] | None = None
) -> Transitions:
    """Build, explore and make the matrices, in one call. `observer` gets events, iterations and the results between.

    Raises ModelFault for a model that breaks a rule at a reachable state, and what `build` raises.
    """
    from symcheck.symbolic.transitions import transitions

    return transitions(explored(model, options, observer, order=order), options, observer)


def explored(
    model: BoundModel, options: BuildSettings, observer: Observer | None = None, *, order: Sequence[str] | None = None
) -> StateSpace:
    """Build and explore: what `construct` does before the matrices are made."""
    space = reach(build(model, options, observer, order=order), observer)
    if observer is not None:
        observer(space)
    return space


def initial_states(model: BoundModel, translator: Translator) -> Bdd:
    """The initial states: those that satisfy `init … endinit`, or the one that the declarations give."""
    encoding = translator.encoding
    if model.initial is None:
        return translator.state({v.name: v.variable.initial for v in encoding.variables if v.variable.initial is not None})
    valuations = translator.manager.conjunction([translator.valid(v) for v in reversed(encoding.ordered)])
    return valuations & translator.boolean_on(model.initial, valuations)
