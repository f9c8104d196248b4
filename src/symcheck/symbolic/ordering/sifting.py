"""Variable orders by sifting: a stage of its own, before the model is built.

Sifting moves each variable through all levels and leaves it where the diagrams are smallest.
Nothing may be reordered while our recursions run, because they hold nodes and levels. So the states
are searched in a separate manager, everything but the states and the relations is released, and
CUDD sifts these with the bits of each variable, and the row and column bit of each pair, held
together as a block. The model is then built again in the order found, which the user may also give
by name.

The choice of the sifted diagrams matters more than the time spent. With the matrices as well,
sifting kanban with t=30 takes 40 times as long and finds the same, and mapk with N=8 ends with
twice the nodes. A part of the states misleads: the first 2 000 nodes of firewire_impl_dl lead to an
order with 2.6 times the nodes of the declared one, all of its states to 0.47 times. So all states
are searched where that takes a bounded number of look-ups; otherwise a part is sifted, and the
search is repeated in the order found. Single bits as blocks gain at most a factor of 1.4 (kanban,
wlan) or nothing (csma, egl).

Work is bounded by counters, so that a model gets the same order on every machine; only the user's
time limit ends it sooner.

Sources: Rudell (1993), Dynamic variable ordering for ordered binary decision diagrams; Panda and
Somenzi (1995), Who are the variables in your neighborhood (group sifting).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.errors import MemoryLimitError, TimeLimitError
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.symbolic import tuning
from symcheck.symbolic.events.encode_events import encode_events
from symcheck.symbolic.model import SymbolicModel
from symcheck.symbolic.ordering.order import FORCE, variable_order
from symcheck.symbolic.reachability.clock_search import (
    apply_clocks,
    cache_lookups,
    clock_relations,
    start_clock_search,
)
from symcheck.symbolic.reachability.search import has_on_the_fly_parts, prepare_saturation
from symcheck.symbolic.tuning import SiftLimits

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["SiftedOrder", "sift"]

_ON_THE_FLY = "as relations are computed on the fly, whose diagrams compress little in any order"
_NOTHING_SIFTED = "as the limits were reached before anything could be sifted"


@dataclass(frozen=True, slots=True)
class SiftedOrder:
    """A variable order found by sifting.

    Attributes:
        order: all variables of the model, from the top of the diagrams down.
        before, after: nodes of the states and relations that were sifted, in the initial order and
            in this one.
        whole: whether all reachable states were sifted.
        note: the reason why the order is the declared one; None if it was sifted.
        seconds: duration of the search for the order.
    """

    order: tuple[str, ...]
    before: int
    after: int
    whole: bool
    note: str | None
    seconds: float

    def __str__(self) -> str:
        if self.note is not None:
            return f"Order: as declared, {self.note}"
        what = "all states" if self.whole else "a part of the states"
        nodes = f"{what} and the relations took {self.before:,} nodes, and take {self.after:,}"
        return f"Order: -order {','.join(self.order)} (sifted in {self.seconds:.2f} s: {nodes})"


@dataclass(frozen=True, eq=False)
class _Sample:
    """The diagrams that are sifted, alone in their manager.

    Attributes:
        pairs: row and column bits of each variable that has bits.
        whole: whether these are all reachable states.
    """

    manager: DiagramManager
    states: Bdd
    relations: tuple[Bdd, ...]
    pairs: Mapping[str, tuple[tuple[str, str], ...]]
    whole: bool

    @property
    def nodes(self) -> int:
        return self.manager.shared_size([self.states, *self.relations])

    def order(self) -> tuple[str, ...]:
        """The variables that have bits, from the top down."""
        name = {pairs[0][0]: variable for variable, pairs in self.pairs.items()}
        return tuple(name[bit] for bit in self.manager.order() if bit in name)


def sift(model: BoundModel, options: Options, limits: SiftLimits | None = None) -> SiftedOrder:
    """Search for a variable order in which the reachable states and the relations of a model have
    few nodes.

    At a limit of memory or time the best order so far is returned; a quarter of the time limit is
    used. It is the declared order where relations are computed on the fly, and where the model
    could not be built within the limits.

    Raises:
        UnsupportedError: a variable without bounds.
        Interrupted: Ctrl-C.
    """
    from symcheck.dd.manager import DiagramManager

    started, limits = perf_counter(), limits or SiftLimits()
    declared = tuple(v.name for v in model.variables)
    order: Sequence[str] | None = None
    result: SiftedOrder | None = None
    for part in limits.part_nodes:
        left = (
            None
            if options.time_limit is None
            else tuning.SIFT_TIME_SHARE * options.time_limit - (perf_counter() - started)
        )
        try:
            sample = _sample(
                model,
                order,
                DiagramManager(max_memory=options.max_memory, time_limit=left),
                limits,
                part,
            )
            if sample is None:
                return SiftedOrder(declared, 0, 0, False, _ON_THE_FLY, perf_counter() - started)
            before = sample.nodes
            _sift(sample, limits)
        except (MemoryLimitError, TimeLimitError):
            if order is not None:
                break
            order = variable_order(model, (FORCE,))
            continue
        order = tuple(dict.fromkeys((*sample.order(), *declared)))
        result = SiftedOrder(
            order, before, sample.nodes, sample.whole, None, perf_counter() - started
        )
        if sample.whole:
            break
    return result or SiftedOrder(declared, 0, 0, False, _NOTHING_SIFTED, perf_counter() - started)


def _sample(
    model: BoundModel,
    order: Sequence[str] | None,
    manager: DiagramManager,
    limits: SiftLimits,
    part: int,
) -> _Sample | None:
    """The states and relations in a manager of their own; None where relations are computed on the
    fly.
    """
    symbolic = encode_events(model, manager, order)
    if has_on_the_fly_parts(symbolic):
        return None
    relations = tuple(r.relation for r in symbolic.relations)
    bits = len(symbolic.encoding.rows)
    states = _all_states(symbolic, limits.lookups)
    whole = states is not None and manager.shared_size([states, *relations]) * bits <= limits.work
    if states is None or not whole:
        states = _some_states(symbolic, part, limits.lookups)
    pairs = {
        v.name: tuple(zip(v.rows, v.columns, strict=True))
        for v in symbolic.encoding.ordered
        if v.width
    }
    return _Sample(manager, states, relations, pairs, whole)


def _all_states(symbolic: SymbolicModel, max_lookups: int) -> Bdd | None:
    """The reachable states, by saturation or else by clock search; None where each takes too many
    look-ups.
    """
    try:
        states = prepare_saturation(symbolic).saturate(symbolic.initial, max_lookups=max_lookups)
        if states is not None or not clock_relations(symbolic):
            return states
        end = cache_lookups(symbolic) + max_lookups
        search = start_clock_search(symbolic)
        while not search.complete:
            left = end - cache_lookups(symbolic)
            following = apply_clocks(symbolic, search, left) if left > 0 else None
            if following is None:
                return None
            search = following
        return search.states
    except MemoryLimitError:
        return None


def _some_states(symbolic: SymbolicModel, nodes: int, max_lookups: int) -> Bdd:
    """Reachable states whose diagram has at least `nodes` nodes, or fewer where there are no more
    or look-ups end.
    """
    states, before = symbolic.initial, symbolic.manager.false
    end = cache_lookups(symbolic) + max_lookups
    while states != before:
        before = states
        for relation in symbolic.relations:
            try:
                states = states | relation.image(states)
            except MemoryLimitError:
                return states
            if states.node_count >= nodes or cache_lookups(symbolic) > end:
                return states
    return states


def _sift(sample: _Sample, limits: SiftLimits) -> None:
    """Sift in rounds until two rounds in a row gain little, or a limit is reached; leave the best
    order.

    CUDD judges how far a block is worth moving by its lowest level alone. If that is a column bit,
    it takes the relations into account but not the states, which have no column bits; if it is a
    row bit, it takes both into account but may stop sooner. So the rounds alternate between the
    two.
    """
    sample.manager.collect()
    bits = sum(map(len, sample.pairs.values()))
    best, least, work, idle = sample.order(), sample.nodes, limits.work, 0
    nodes = least
    for lowest_is_row in cycle((True, False)):
        if idle == 2 or nodes * bits > work:
            break
        work -= nodes * bits
        try:
            sample.manager.sift(
                _set_order(sample, sample.order(), lowest_is_row=lowest_is_row), limits.growth
            )
        except TimeLimitError:
            sample.manager.limit_time(None)  # the remaining operations only set the order
            work = 0
        _set_order(sample, sample.order())
        nodes = sample.nodes
        idle = idle + 1 if nodes > (1 - limits.gain) * least else 0
        if nodes < least:
            best, least = sample.order(), nodes
    _set_order(sample, best)


def _set_order(
    sample: _Sample, order: Sequence[str], *, lowest_is_row: bool = False
) -> list[list[str]]:
    """Set the order of the variables' blocks, with column bits below or above their row bits;
    returns the blocks.
    """
    blocks = []
    for variable in order:
        pairs = [
            (column, row) if lowest_is_row else (row, column)
            for row, column in sample.pairs[variable]
        ]
        blocks.append([bit for pair in pairs for bit in pair])
    sample.manager.reorder([bit for block in blocks for bit in block])
    return blocks
