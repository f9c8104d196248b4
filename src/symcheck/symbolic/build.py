"""Building: a bound model becomes guards, updates and relations; with `construct`, everything an engine needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from symcheck.errors import converts_memory_error
from symcheck.semantics.model import BoundModel
from symcheck.semantics.settings import BuildSettings
from symcheck.symbolic.encoding.translate import Limits
from symcheck.symbolic.events.encode_events import assemble
from symcheck.symbolic.model import StateSpace, SymbolicModel, Transitions
from symcheck.symbolic.ordering.order import is_sifted, variable_order
from symcheck.symbolic.reachability.search import reach

if TYPE_CHECKING:
    from symcheck.dd.manager import DiagramManager

__all__ = ["Observer", "build", "chosen_order", "construct", "explored"]

Observer = Callable[[object], None]


@converts_memory_error()
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

    `observer` gets a SiftedOrder where one is found, and each EncodedEvent as it is made. `order`: names of variables from the
    top of the diagrams down; by default what the options say.
    `manager`: a fresh diagram manager to build in. Raises UnsupportedError for unbounded integers, ResourceError at a limit.
    """
    order = order or chosen_order(model, options, observer)
    if manager is None:
        from symcheck.dd.manager import DiagramManager

        manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    return assemble(model, manager, order, observer, limits=limits)


def chosen_order(
    model: BoundModel, options: BuildSettings, observer: Observer | None = None
) -> tuple[str, ...] | None:
    """The names from the top of the diagrams down that the options stand for; None is declaration order.

    An order that sifting finds is looked for here, and told to the observer as a SiftedOrder. Raises UsageError for a name that
    no variable has, and what `sift` raises.
    """
    if not is_sifted(model, options.order):
        return variable_order(model, options.order)
    from symcheck.symbolic.ordering.sifting import sift

    found = sift(model, options)
    if observer is not None:
        observer(found)
    return found.order


def construct(
    model: BoundModel,
    options: BuildSettings,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
) -> Transitions:
    """Build, explore and make the matrices, in one call. `observer` gets events, iterations and the results between.

    Raises ModelFault for a model that breaks a rule at a reachable state, and what `build` raises.
    """
    from symcheck.symbolic.matrix.transitions import transitions

    return transitions(explored(model, options, observer, order=order), options, observer)


def explored(
    model: BoundModel,
    options: BuildSettings,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
) -> StateSpace:
    """Build and explore: what `construct` does before the matrices are made."""
    space = reach(build(model, options, observer, order=order), observer)
    if observer is not None:
        observer(space)
    return space
