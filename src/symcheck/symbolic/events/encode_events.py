"""The events of a model as diagrams, in a given manager and variable order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from symcheck.semantics.model import BoundModel
from symcheck.symbolic.encoding.translate import Translator
from symcheck.symbolic.encoding.variables import encode
from symcheck.symbolic.events.commands import encode_event, with_maximal_progress
from symcheck.symbolic.events.relations import group_relations
from symcheck.symbolic.model import EncodedEvent, SymbolicModel
from symcheck.symbolic.tuning import EncodingLimits

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["encode_events"]


def encode_events(
    model: BoundModel,
    manager: DiagramManager,
    order: Sequence[str] | None,
    observer: Callable[[object], None] | None = None,
    *,
    limits: EncodingLimits | None = None,
) -> SymbolicModel:
    """The bits, guards, updates and transition relations of a model in a new manager.

    Args:
        model: the model.
        manager: the new manager.
        order: names of variables from the top of the diagrams down; None: declaration order.
        observer: is called with each EncodedEvent.
        limits: as in `build`.

    Raises:
        UnsupportedError: a variable without bounds.
        ResourceError: a limit of the manager is reached.
    """
    encoding = encode(model, order)
    manager.add_variables(encoding.bits)
    translator = Translator(manager, encoding, limits)
    events: list[EncodedEvent] = []
    for event in model.events:
        encoded = encode_event(translator, event)
        events.append(encoded)
        if observer is not None:
            observer(encoded)
    events = with_maximal_progress(translator, events)
    initial = _initial_states(model, translator)
    return SymbolicModel(
        model,
        manager,
        encoding,
        translator,
        initial,
        tuple(events),
        group_relations(manager, encoding, events),
    )


def _initial_states(model: BoundModel, translator: Translator) -> Bdd:
    """The states that satisfy `init … endinit`, or the one given by the declarations."""
    encoding = translator.encoding
    if model.initial is None:
        return translator.state(
            {
                v.name: v.variable.initial
                for v in encoding.variables
                if v.variable.initial is not None
            }
        )
    valuations = translator.valuations()
    return valuations & translator.boolean_on(model.initial, valuations)
