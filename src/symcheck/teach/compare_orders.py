"""The same model under several variable orders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, permutations
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.options import Options
from symcheck.symbolic.build import build
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.symbolic.reachability.search import reach
from symcheck.teach.source import bound_of
from symcheck.view.choice_graph import GivenModel

if TYPE_CHECKING:
    from symcheck.semantics.model import BoundModel

__all__ = ["OrderFrame", "compare_orders"]


@dataclass(frozen=True, slots=True)
class OrderFrame:
    """A model built under one variable order: states, diagram nodes, seconds.

    Nodes of the matrix and at the peak are None where there is no CUDD: only the reachable states
    are computed there.
    """

    order: tuple[str, ...]
    states: int
    states_nodes: int
    matrix_nodes: int | None
    peak_nodes: int | None
    seconds: float


def compare_orders(
    model: GivenModel | BoundModel,
    options: Options | None = None,
    orders: Iterable[Sequence[str]] | None = None,
    *,
    limit: int = 120,
) -> Iterator[OrderFrame]:
    """Build a model under each variable order, in a diagram manager of its own.

    Args:
        model: the model, or the bound model.
        options: limits of memory and time.
        orders: variable names from the top of the diagrams down. None: all permutations.
        limit: the most orders that are tried.

    Raises:
        SymcheckError: as `construct`.
    """
    bound = bound_of(model)
    options = options or Options()
    names = [v.name for v in bound.variables]
    for order in islice(permutations(names) if orders is None else orders, limit):
        started = perf_counter()
        symbolic = build(bound, options, order=order)
        manager, space = symbolic.manager, reach(symbolic)
        made = transitions(space, options) if manager.has_mtbdds else None
        seconds = perf_counter() - started
        yield OrderFrame(
            tuple(v.name for v in symbolic.encoding.ordered),
            space.count,
            space.states.node_count,
            None if made is None else manager.shared_size(made.roots),
            None if made is None else manager.statistics().peak_live_nodes,
            seconds,
        )
