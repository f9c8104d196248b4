"""Reachable states, by image computation with partitioned transition relations.

Schedules (`schedule` of `search`):

- `frontier`: breadth first. Each iteration takes the images of the states found last under every
  relation.
- `chaining`: each relation in turn is applied to all states found so far, so that one sweep does
  the work of many breadth-first steps, on larger sets (Roig, Cortadella and Pastor 1995).
- `saturation`: node by node, from the bottom of the diagrams up (Ciardo, Lüttgen and Siminiceanu
  2001). It is the best one nearly always.
- `clock`: where a clock changes nearly every variable; the states that a tick reaches are saturated
  with the other relations (`clock_search.py`).
- `alternating`: saturation and clock search in turns, until one of them ends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from symcheck.errors import converts_memory_error
from symcheck.symbolic.checks import check_initial
from symcheck.symbolic.events.commands import (
    encode_event,
    evaluated_valuations,
    with_maximal_progress,
)
from symcheck.symbolic.events.relations import group_relations
from symcheck.symbolic.model import EncodedEvent, Iteration, StateSpace, SymbolicModel
from symcheck.symbolic.reachability.clock_search import (
    alternate,
    apply_clocks,
    clock_relations,
    start_clock_search,
)

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Saturation

__all__ = ["SCHEDULES", "SearchState", "reach", "search"]


@dataclass(frozen=True, eq=False)
class SearchState:
    """The state of a search after an iteration.

    Attributes:
        symbolic: the model, complete on `states` where relations are computed on the fly.
        states: the states found so far.
        frontier: those found last.
        iteration: the counters of this iteration.
        schedule: the schedule that found them.
    """

    symbolic: SymbolicModel
    states: Bdd
    frontier: Bdd
    iteration: Iteration
    schedule: str


@converts_memory_error()
def reach(
    symbolic: SymbolicModel,
    observer: Callable[[object], None] | None = None,
    *,
    schedule: str | None = None,
    watch: Callable[[SearchState], object] | None = None,
) -> StateSpace:
    """The reachable states, and the deadlocks among them.

    Args:
        symbolic: the encoded model, as `build` gives it.
        observer: is called with each Iteration. Without one, states and nodes are not counted on
            the way, which may take as long as the search.
        schedule: one of SCHEDULES; None: chosen for the model.
        watch: is called with each SearchState.

    Raises:
        ModelFault: no state is initial.
        ResourceError: a limit of the manager (set by `build`) is reached.

    Examples:
        >>> import symcheck
        >>> text = "dtmc module m x:[0..5]; [] x<3 -> (x'=x+1); endmodule"
        >>> model = symcheck.bind(symcheck.parse_model(text))
        >>> space = symcheck.reach(symcheck.build(model, symcheck.Options()))
        >>> space.count, list(space.valuations(space.deadlocks))
        (4, [(3,)])
    """
    check_initial(symbolic)
    started = time.perf_counter()
    schedule = schedule or choose_schedule(symbolic)
    iterations: list[Iteration] = []
    for state in search(symbolic, schedule, counting=observer is not None):
        complete, states, schedule = state.symbolic, state.states, state.schedule
        iterations.append(state.iteration)
        if watch is not None:
            watch(state)
        if observer is not None:
            observer(state.iteration)
    deadlocks = states - enabled(complete)
    count = symbolic.manager.count(states, symbolic.encoding.rows)
    return StateSpace(
        complete,
        states,
        deadlocks,
        count,
        schedule,
        time.perf_counter() - started,
        tuple(iterations),
    )


def enabled(symbolic: SymbolicModel) -> Bdd:
    """The states with a transition."""
    return symbolic.manager.disjunction(
        [r.relation.exists(r.transition.columns) for r in symbolic.relations]
    )


def choose_schedule(symbolic: SymbolicModel) -> str:
    """The schedule for a model: saturation, except where relations are computed on the fly.

    On PRISM's benchmark suite saturation wins by 3 to 300 times nearly everywhere. Where a relation
    looks like a clock, it may lose by as much (csma) or win all the same (firewire_impl_dl), so
    both alternate.
    """
    if has_on_the_fly_parts(symbolic):
        return "frontier"
    return "alternating" if clock_relations(symbolic) else "saturation"


def search(
    symbolic: SymbolicModel, schedule: str = "frontier", *, counting: bool = True
) -> Iterator[SearchState]:
    """Explore step by step; the last item has all reachable states.

    Args:
        symbolic: the encoded model.
        schedule: one of SCHEDULES.
        counting: whether iterations have numbers of states and nodes.

    Raises:
        ValueError: an unknown schedule, or one other than frontier where relations are computed on
            the fly.
    """
    if schedule not in SCHEDULES:
        raise ValueError(f"unknown schedule {schedule}: one of {', '.join(SCHEDULES)}")
    if schedule != "frontier" and has_on_the_fly_parts(symbolic):
        raise ValueError(f"schedule {schedule} cannot compute relations on the fly: use frontier")
    started = time.perf_counter()
    for number, (model, states, frontier, how) in enumerate(SCHEDULES[schedule](symbolic)):
        yield SearchState(
            model,
            states,
            frontier,
            _measure(model, number, states, frontier, started, counting),
            how,
        )


def _measure(
    symbolic: SymbolicModel, number: int, states: Bdd, frontier: Bdd, started: float, counting: bool
) -> Iteration:
    count, bits = symbolic.manager.count, symbolic.encoding.rows
    seconds = time.perf_counter() - started
    if not counting:
        return Iteration(number, None, None, None, None, seconds)
    return Iteration(
        number,
        count(states, bits),
        states.node_count,
        count(frontier, bits),
        frontier.node_count,
        seconds,
    )


# ---------------------------------------------------------------------------------------- schedules

SearchStates = Iterator[tuple[SymbolicModel, "Bdd", "Bdd", str]]
"""The model, the states found so far, the new ones among them, and the schedule that found them."""


def _by_frontier(symbolic: SymbolicModel) -> SearchStates:
    states = frontier = symbolic.initial
    yield symbolic, states, frontier, "frontier"
    while frontier:
        symbolic = extend_relations(symbolic, frontier)
        frontier = symbolic.successors(frontier) - states
        states = states | frontier
        if frontier:
            yield symbolic, states, frontier, "frontier"
    yield symbolic, states, frontier, "frontier"  # complete on the last frontier


def _by_chaining(symbolic: SymbolicModel) -> SearchStates:
    states, before = symbolic.initial, symbolic.manager.false
    while states != before:
        yield symbolic, states, states - before, "chaining"
        before = states
        for relation in symbolic.relations:
            states = states | relation.image(states)
    yield symbolic, states, symbolic.manager.false, "chaining"


def _by_saturation(symbolic: SymbolicModel) -> SearchStates:
    from symcheck.dd.saturation import saturate

    yield symbolic, symbolic.initial, symbolic.initial, "saturation"
    states = saturate(prepare_saturation(symbolic), symbolic.initial)
    if states is None:
        yield from _by_chaining(symbolic)
    else:
        yield symbolic, states, states - symbolic.initial, "saturation"


def _by_clock(symbolic: SymbolicModel) -> SearchStates:
    yield symbolic, symbolic.initial, symbolic.initial, "clock"
    search = start_clock_search(symbolic)
    while not search.complete:
        following = apply_clocks(symbolic, search)
        if following is None:
            yield from _by_chaining(symbolic)
            return
        search = following
        yield symbolic, search.states, search.frontier - symbolic.initial, "clock"


def _alternating(symbolic: SymbolicModel) -> SearchStates:
    yield symbolic, symbolic.initial, symbolic.initial, "saturation"
    complete = False
    for phase in alternate(symbolic, prepare_saturation(symbolic)):
        complete = phase.complete
        yield symbolic, phase.states, phase.frontier, phase.schedule
    if not complete:
        yield from _by_chaining(symbolic)


def prepare_saturation(symbolic: SymbolicModel, *, forward: bool = True) -> Saturation:
    """All relations of a model, prepared for saturation."""
    return symbolic.manager.saturation(
        [(r.relation, r.transition) for r in symbolic.relations], forward=forward
    )


SCHEDULES: dict[str, Callable[[SymbolicModel], SearchStates]] = {
    "frontier": _by_frontier,
    "chaining": _by_chaining,
    "saturation": _by_saturation,
    "clock": _by_clock,
    "alternating": _alternating,
}


# ----------------------------------------------------------------------------- relations on the fly


def has_on_the_fly_parts(symbolic: SymbolicModel) -> bool:
    """Whether an event is encoded on the fly, for the valuations that are reached."""
    return any(e.evaluated is not None for e in symbolic.events)


def extend_relations(symbolic: SymbolicModel, states: Bdd) -> SymbolicModel:
    """Complete the events that are encoded on the fly on `states`; the same model if nothing is
    new.
    """
    if not has_on_the_fly_parts(symbolic):
        return symbolic
    translator = symbolic.translator
    events = list(symbolic.events)
    for number, event in enumerate(events):
        # Repeated while something is new: once a guard is known to hold, the updates behind it are
        # evaluated too, and an expression of this event may have been evaluated for another event.
        while event.evaluated is not None and (
            _extend(symbolic, event, states)
            or evaluated_valuations(translator, event.event) != event.evaluated
        ):
            event = events[number] = encode_event(translator, event.event)
    if all(new is old for new, old in zip(events, symbolic.events, strict=True)):
        return symbolic
    events = with_maximal_progress(translator, events)
    return replace(
        symbolic,
        events=tuple(events),
        relations=group_relations(symbolic.manager, symbolic.encoding, events),
    )


def _extend(symbolic: SymbolicModel, event: EncodedEvent, states: Bdd) -> bool:
    """Evaluate the parts of an event that are encoded on the fly on `states`; whether a valuation
    was new.
    """
    translator, changed = symbolic.translator, False
    for command in (c for commands in event.event.participants for c in commands):
        always, guarded = translator.on_the_fly_parts(command)
        for part in always:
            changed |= part.extend(states)
        if guarded:
            here = states & translator.boolean(command.guard)
            for part in guarded:
                changed |= part.extend(here)
    return changed
