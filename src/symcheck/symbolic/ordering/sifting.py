"""An order of the variables that sifting finds: a stage of its own, before a model is built.

Sifting (Rudell 1993) moves each variable through all levels and leaves it where the diagrams are smallest. Recursions of our
own hold nodes and levels, so nothing is reordered while they run. Instead the states are searched in a manager made for
this, everything but the states and the relations is let go, and CUDD sifts these two with the bits of each variable, and of
each the row and the column bit, held together as a block (group sifting: Panda & Somenzi 1995). The model is then built anew
in the order found: all above sees one more static order, and the same order can be given by name.

What is sifted matters more than how long. Matrices hold the same structure ten times over: with them, sifting kanban t=30 takes
40 times as long and finds the same; mapk N=8 ends with twice the nodes. A part of the states misleads: the first 2 000 nodes
of firewire_impl_dl lead to an order with 2.6 times the nodes of the declared one, all of its states to 0.47. So all states are
searched where that takes a bounded number of look-ups, and a part is taken only where it does not, to search again in the
order that it gave. Single bits as blocks would gain up to 1.4 beyond whole variables (kanban, wlan) or nothing (csma, egl).

Work is bounded by counters, so that the same model gets the same order on any machine; only a limit of time ends it sooner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.errors import MemoryLimitError, TimeLimitError
from symcheck.semantics.model import BoundModel
from symcheck.semantics.settings import BuildSettings
from symcheck.symbolic.events.encode_events import assemble
from symcheck.symbolic.model import SymbolicModel
from symcheck.symbolic.ordering.order import FORCE, variable_order
from symcheck.symbolic.reachability.clock_search import advance, begin, clocks
from symcheck.symbolic.reachability.search import learns, prepare_saturation

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager

__all__ = ["SiftLimits", "SiftedOrder", "sift"]

_LEARNED = "as relations are learned for the states that are reached, and diagrams of such compress little in any order"
_NOTHING = "as the limits were met before anything could be sifted"
_SHARE = 0.25  # of the time limit that looking for an order may take


@dataclass(frozen=True, slots=True)
class SiftLimits:
    """What looking for an order may cost.

    steps: look-ups in CUDD's cache of one search for all states; two million are about a second.
    parts: nodes of the part of the states that is sifted where the search is too long, one try after the other.
    work: nodes times bits of all rounds of sifting; two million are about a second.
    growth: how much the diagrams may grow while a variable moves.
    gain: sifting ends with the second round in a row that makes the diagrams smaller by less than this share.
    """

    steps: int = 20_000_000
    parts: tuple[int, ...] = (20_000, 50_000, 100_000)
    work: int = 40_000_000
    growth: float = 1.2
    gain: float = 0.1


@dataclass(frozen=True, slots=True)
class SiftedOrder:
    """An order, from the top of the diagrams down, of all variables of a model.

    before, after: nodes of the states and relations that were sifted, in the order that was there and in this one.
    whole: whether these were all reachable states. note: why the order is as declared, None where it was sifted.
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
    """What is sifted, and nothing else that its manager would hold. pairs: row and column bits of each variable that has some."""

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


def sift(
    model: BoundModel, options: BuildSettings, limits: SiftLimits | None = None
) -> SiftedOrder:
    """Look for an order of the variables in which the reachable states and the relations of `model` have few nodes.

    Where a limit of memory or time ends the search, the order is what was found until then; a quarter of the time limit is
    used. Where relations are learned on the way, and where nothing could be built, it is as declared. Raises UnsupportedError for
    unbounded integers, and Interrupted.
    """
    from symcheck.dd.manager import DiagramManager

    started, limits = perf_counter(), limits or SiftLimits()
    declared = tuple(v.name for v in model.variables)
    order: Sequence[str] | None = None
    found: SiftedOrder | None = None
    for part in limits.parts:
        left = (
            None
            if options.time_limit is None
            else _SHARE * options.time_limit - (perf_counter() - started)
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
                return SiftedOrder(declared, 0, 0, False, _LEARNED, perf_counter() - started)
            before = sample.nodes
            _sift(sample, limits)
        except (MemoryLimitError, TimeLimitError):
            if order is not None:
                break
            order = variable_order(model, (FORCE,))
            continue
        order = tuple(dict.fromkeys((*sample.order(), *declared)))
        found = SiftedOrder(
            order, before, sample.nodes, sample.whole, None, perf_counter() - started
        )
        if sample.whole:
            break
    return found or SiftedOrder(declared, 0, 0, False, _NOTHING, perf_counter() - started)


def _sample(
    model: BoundModel,
    order: Sequence[str] | None,
    manager: DiagramManager,
    limits: SiftLimits,
    part: int,
) -> _Sample | None:
    """States and relations in a manager made for them; None where relations are learned."""
    symbolic = assemble(model, manager, order)
    if learns(symbolic):
        return None
    relations = tuple(r.relation for r in symbolic.relations)
    bits = len(symbolic.encoding.rows)
    states = _all_states(symbolic, limits.steps)
    whole = states is not None and manager.shared_size([states, *relations]) * bits <= limits.work
    if states is None or not whole:
        states = _some_states(symbolic, part, limits.steps)
    pairs = {
        v.name: tuple(zip(v.rows, v.columns, strict=True))
        for v in symbolic.encoding.ordered
        if v.width
    }
    return _Sample(manager, states, relations, pairs, whole)


def _all_states(symbolic: SymbolicModel, steps: int) -> Bdd | None:
    """The reachable states, by saturation and then by ticks; None where both take more than so many look-ups."""
    try:
        states = prepare_saturation(symbolic).saturate(symbolic.initial, max_lookups=steps)
        if states is not None or not clocks(symbolic):
            return states
        end = _lookups(symbolic) + steps
        front = begin(symbolic)
        while not front.done:
            left = end - _lookups(symbolic)
            following = advance(symbolic, front, left) if left > 0 else None
            if following is None:
                return None
            front = following
        return front.states
    except MemoryLimitError:
        return None


def _some_states(symbolic: SymbolicModel, nodes: int, steps: int) -> Bdd:
    """Reachable states of at least so many nodes, unless there are fewer or the look-ups are used up."""
    states, before = symbolic.initial, symbolic.manager.false
    end = _lookups(symbolic) + steps
    while states != before:
        before = states
        for relation in symbolic.relations:
            try:
                states = states | relation.image(states)
            except MemoryLimitError:
                return states
            if states.node_count >= nodes or _lookups(symbolic) > end:
                return states
    return states


def _lookups(symbolic: SymbolicModel) -> int:
    return int(symbolic.manager.statistics().cache_lookups)


def _sift(sample: _Sample, limits: SiftLimits) -> None:
    """Sift as long as that gains. A limit of time ends it in the order reached by then, which is as good as any on the way.

    CUDD judges how far a block is worth moving by its lowest level alone. Where that is a column bit, it sees the relations
    that mention it, but not the states, which have no columns; where it is a row bit, it sees both, and may give up sooner. So
    rounds take turns, and two that gain little end it.
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
                _place(sample, sample.order(), lowest_is_row=lowest_is_row), limits.growth
            )
        except TimeLimitError:
            sample.manager.limit_time(None)  # what is asked of the manager from now on is its order
            work = 0
        _place(sample, sample.order())
        nodes = sample.nodes
        idle = idle + 1 if nodes > (1 - limits.gain) * least else 0
        if nodes < least:
            best, least = sample.order(), nodes
    _place(sample, best)


def _place(
    sample: _Sample, order: Sequence[str], *, lowest_is_row: bool = False
) -> list[list[str]]:
    """The block of each variable, put in this order with the column bit of each pair below the row bit, or above."""
    blocks = []
    for variable in order:
        pairs = [
            (column, row) if lowest_is_row else (row, column)
            for row, column in sample.pairs[variable]
        ]
        blocks.append([bit for pair in pairs for bit in pair])
    sample.manager.reorder([bit for block in blocks for bit in block])
    return blocks
