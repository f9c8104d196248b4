"""Symbolic model construction: `build` encodes a bound model, `construct` also computes its state
space and matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

from symcheck.errors import converts_memory_error
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.events.encode_events import encode_events
from symcheck.symbolic.model import StateSpace, SymbolicModel, Transitions
from symcheck.symbolic.ordering.order import is_sifted, variable_order
from symcheck.symbolic.reachability.search import reach
from symcheck.symbolic.tuning import EncodingLimits

if TYPE_CHECKING:
    from symcheck.dd.manager import DiagramManager

__all__ = ["Observer", "build", "build_state_space", "chosen_order", "construct"]

Observer = Callable[[object], None]


@converts_memory_error()
def build(
    model: BoundModel,
    options: Options,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
    manager: DiagramManager | None = None,
    limits: EncodingLimits | None = None,
) -> SymbolicModel:
    """Encode a model as diagrams: bits, guards, updates and transition relations.

    Args:
        model: the model.
        options: limits of memory and time, and the variable order.
        observer: is called with a SiftedOrder, where sifting finds one, and with each EncodedEvent.
        order: names of variables from the top of the diagrams down; None: as in the options.
        manager: a new diagram manager to use; None: one is created, with CUDD or, where there is
            none, with the BDDs of dd.autoref, which are for teaching.
        limits: where one way of translating expressions ends and the next begins; None: the default
            limits.

    Returns:
        The encoded model, the argument of `reach`.

    Raises:
        UnsupportedError: a variable without bounds.
        ResourceError: a limit of memory or time is reached.

    Examples:
        >>> import symcheck
        >>> text = "dtmc module m x:[0..5]; [] x<5 -> (x'=x+1); endmodule"
        >>> model = symcheck.bind(symcheck.parse_model(text))
        >>> symcheck.build(model, symcheck.Options()).encoding.rows
        ('x.2', 'x.1', 'x.0')
    """
    order = order or chosen_order(model, options, observer)
    return encode_events(model, manager or _new_manager(options), order, observer, limits=limits)


def _new_manager(options: Options) -> DiagramManager:
    from symcheck.dd.cudd_import import available

    if not available():
        from symcheck.dd.python_manager import PythonManager

        # It has the part of the interface that sets need, and refuses MTBDDs.
        return cast("DiagramManager", PythonManager(options.time_limit))
    from symcheck.dd.manager import DiagramManager

    return DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)


def chosen_order(
    model: BoundModel, options: Options, observer: Observer | None = None
) -> tuple[str, ...] | None:
    """The variable order that the options ask for: names from the top down; None is declaration
    order.

    Sifting is done here, and the observer is called with its SiftedOrder. Raises UsageError for an
    unknown name, and as `sift`.
    """
    if not is_sifted(model, options.order):
        return variable_order(model, options.order)
    from symcheck.symbolic.ordering.sifting import sift

    sifted = sift(model, options)
    if observer is not None:
        observer(sifted)
    return sifted.order


def construct(
    model: BoundModel,
    options: Options,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
) -> Transitions:
    """Encode a model, search its reachable states and compute its matrices.

    Args:
        model: the model.
        options: as in `build`.
        observer: is called with events, iterations and the results of the stages.
        order: as in `build`.

    Raises:
        ModelFault: the model breaks a rule in a reachable state.
        UnsupportedError, ResourceError: as `build`.
    """
    from symcheck.symbolic.matrix.transitions import transitions

    return transitions(build_state_space(model, options, observer, order=order), options, observer)


def build_state_space(
    model: BoundModel,
    options: Options,
    observer: Observer | None = None,
    *,
    order: Sequence[str] | None = None,
) -> StateSpace:
    """Encode a model and search its reachable states: `construct` without the matrices. Raises
    UnsupportedError where there is no CUDD.
    """
    from symcheck.dd.cudd_import import library

    library()  # an engine does not search in pure Python what it then cannot multiply
    space = reach(build(model, options, observer, order=order), observer)
    if observer is not None:
        observer(space)
    return space
