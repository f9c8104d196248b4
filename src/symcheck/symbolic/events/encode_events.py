"""A model's events as diagrams in a given order of the variables, in a given manager."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from symcheck.semantics.model import BoundModel
from symcheck.symbolic.encoding.translate import Limits, Translator
from symcheck.symbolic.encoding.variables import encode
from symcheck.symbolic.events.commands import encode_event
from symcheck.symbolic.events.relations import group_relations
from symcheck.symbolic.model import EncodedEvent, SymbolicModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["assemble"]


def assemble(
    model: BoundModel,
    manager: DiagramManager,
    order: Sequence[str] | None,
    observer: Callable[[object], None] | None = None,
    *,
    limits: Limits | None = None,
) -> SymbolicModel:
    """Bits, guards, updates and relations of a model in a fresh manager. `observer` gets each EncodedEvent as it is made.

    `order`: names of variables from the top of the diagrams down; None is declaration order. Raises UnsupportedError for
    unbounded integers, ResourceError at a limit.
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
    """The initial states: those that satisfy `init … endinit`, or the one that the declarations give."""
    encoding = translator.encoding
    if model.initial is None:
        return translator.state(
            {
                v.name: v.variable.initial
                for v in encoding.variables
                if v.variable.initial is not None
            }
        )
    valuations = translator.manager.conjunction(
        [translator.valid(v) for v in reversed(encoding.ordered)]
    )
    return valuations & translator.boolean_on(model.initial, valuations)
