"""The reachable states, by image computation with partitioned relations.

Schedules (`schedule` of `search`):

- `frontier`: breadth first. Each iteration takes the images of the states found last, by every relation.
- `chaining`: each relation in turn is applied to all states found so far, so one sweep does the work of many steps
  (Roig, Cortadella & Pastor 1995). Few sweeps, but each image is of a larger set.
- `saturation`: node by node: the set under a node is closed under what does not change the variables above it, before
  anything above is applied again (Ciardo, Lüttgen & Siminiscalco 2001; see `DiagramManager.saturation`). One step, best nearly
  always.
- `ticks`: where a clock changes nearly every variable. What a tick finds is closed under all else by saturation (`symbolic/reachability/clock_search.py`).
- `turns`: saturation and ticks in turn, until one of them ends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from symcheck.errors import converts_memory_error
from symcheck.symbolic.checks import check_initial
from symcheck.symbolic.events.commands import encode_event, knowledge
from symcheck.symbolic.events.relations import group_relations
from symcheck.symbolic.model import EncodedEvent, Iteration, StateSpace, SymbolicModel
from symcheck.symbolic.reachability.clock_search import advance, begin, clocks, turns

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Saturation

__all__ = ["SCHEDULES", "Found", "reach", "search"]


@dataclass(frozen=True, eq=False)
class Found:
    """What the search knows after an iteration: states, those found last, and the model as far as it is learned.

    `schedule`: how they were found, which of several says where they take turns.
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
    watch: Callable[[Found], object] | None = None,
) -> StateSpace:
    """All reachable states, and those of them that have no transition (deadlocks).

    `observer` gets each Iteration; without one, neither states nor nodes are counted on the way (which may cost as much
    as the search). `watch` gets what is found, of which nothing need be counted. `schedule`: one of SCHEDULES, by default
    chosen for the model. Raises ResourceError at a limit (of the manager, set by `build`), and ModelFault where no state is
    initial.
    """
    check_initial(symbolic)
    started = time.perf_counter()
    schedule = schedule or choose_schedule(symbolic)
    iterations: list[Iteration] = []
    for found in search(symbolic, schedule, counting=observer is not None):
        complete, states, schedule = found.symbolic, found.states, found.schedule
        iterations.append(found.iteration)
        if watch is not None:
            watch(found)
        if observer is not None:
            observer(found.iteration)
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
    """States with some transition."""
    return symbolic.manager.disjunction(
        [r.relation.exists(r.transition.columns) for r in symbolic.relations]
    )


def choose_schedule(symbolic: SymbolicModel) -> str:
    """A schedule by the model's structure: saturation, unless relations are to be learned on the way.

    Measured on the PRISM benchmark suite: saturation wins by 3 to 300 times nearly everywhere. Where there is something like
    a clock, it may lose by as much (csma), or win all the same (firewire_impl_dl): it takes turns with ticks.
    """
    if learns(symbolic):
        return "frontier"
    return "turns" if clocks(symbolic) else "saturation"


def search(
    symbolic: SymbolicModel, schedule: str = "frontier", *, counting: bool = True
) -> Iterator[Found]:
    """Explore step by step; the last value has all reachable states. `counting`: fill in numbers of states and nodes.

    Raises ValueError for an unknown schedule, or one that cannot learn (all but frontier) where something is to learn.
    """
    if schedule not in SCHEDULES:
        raise ValueError(f"unknown schedule {schedule}: one of {', '.join(SCHEDULES)}")
    if schedule != "frontier" and learns(symbolic):
        raise ValueError(f"schedule {schedule} cannot learn relations on the way: use frontier")
    started = time.perf_counter()
    for number, (model, states, frontier, how) in enumerate(SCHEDULES[schedule](symbolic)):
        yield Found(
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


# ------------------------------------------------------------------------------------------------ schedules

Progress = Iterator[tuple[SymbolicModel, "Bdd", "Bdd", str]]
"""The model as far as it is learned, states found so far, those of them that are new, and how they were found."""


def _by_frontier(symbolic: SymbolicModel) -> Progress:
    states = frontier = symbolic.initial
    yield symbolic, states, frontier, "frontier"
    while frontier:
        symbolic = learn(symbolic, frontier)
        frontier = symbolic.successors(frontier) - states
        states = states | frontier
        if frontier:
            yield symbolic, states, frontier, "frontier"
    yield symbolic, states, frontier, "frontier"  # with what the last frontier taught


def _by_chaining(symbolic: SymbolicModel) -> Progress:
    states, before = symbolic.initial, symbolic.manager.false
    while states != before:
        yield symbolic, states, states - before, "chaining"
        before = states
        for relation in symbolic.relations:
            states = states | relation.image(states)
    yield symbolic, states, symbolic.manager.false, "chaining"


def _by_saturation(symbolic: SymbolicModel) -> Progress:
    from symcheck.dd.saturation import saturate

    yield symbolic, symbolic.initial, symbolic.initial, "saturation"
    states = saturate(prepare_saturation(symbolic), symbolic.initial)
    if states is None:
        yield from _by_chaining(symbolic)
    else:
        yield symbolic, states, states - symbolic.initial, "saturation"


def _by_ticks(symbolic: SymbolicModel) -> Progress:
    yield symbolic, symbolic.initial, symbolic.initial, "ticks"
    front = begin(symbolic)
    while not front.done:
        following = advance(symbolic, front)
        if following is None:
            yield from _by_chaining(symbolic)
            return
        front = following
        yield symbolic, front.states, front.frontier - symbolic.initial, "ticks"


def _by_turns(symbolic: SymbolicModel) -> Progress:
    yield symbolic, symbolic.initial, symbolic.initial, "saturation"
    found = False
    for step in turns(symbolic, prepare_saturation(symbolic)):
        found = step.complete
        yield symbolic, step.states, step.frontier, step.schedule
    if not found:
        yield from _by_chaining(symbolic)


def prepare_saturation(symbolic: SymbolicModel, *, forward: bool = True) -> Saturation:
    """All relations of a model, prepared for closing sets under them."""
    return symbolic.manager.saturation(
        [(r.relation, r.transition) for r in symbolic.relations], forward=forward
    )


SCHEDULES: dict[str, Callable[[SymbolicModel], Progress]] = {
    "frontier": _by_frontier,
    "chaining": _by_chaining,
    "saturation": _by_saturation,
    "ticks": _by_ticks,
    "turns": _by_turns,
}


# ------------------------------------------------------------------------------------------------ learning


def learns(symbolic: SymbolicModel) -> bool:
    """Whether some event is encoded only for the valuations that are reached."""
    return any(e.learned is not None for e in symbolic.events)


def learn(symbolic: SymbolicModel, states: Bdd) -> SymbolicModel:
    """Complete the learned events on `states`; the same model if nothing is new."""
    if not learns(symbolic):
        return symbolic
    translator = symbolic.translator
    events = list(symbolic.events)
    for number, event in enumerate(events):
        # Again as long as something is new: once a guard is known to hold, what is behind it has to be learned as well,
        # and other events may have taught what this one reads.
        while event.learned is not None and (
            _extend(symbolic, event, states) or knowledge(translator, event.event) != event.learned
        ):
            event = events[number] = encode_event(translator, event.event)
    if all(new is old for new, old in zip(events, symbolic.events, strict=True)):
        return symbolic
    return replace(
        symbolic,
        events=tuple(events),
        relations=group_relations(symbolic.manager, symbolic.encoding, events),
    )


def _extend(symbolic: SymbolicModel, event: EncodedEvent, states: Bdd) -> bool:
    """Evaluate the learned parts of an event on `states`; whether anything was new."""
    translator, changed = symbolic.translator, False
    for command in (c for commands in event.event.participants for c in commands):
        always, guarded = translator.learned_parts(command)
        for part in always:
            changed |= part.extend(states)
        if guarded:
            here = states & translator.boolean(command.guard)
            for part in guarded:
                changed |= part.extend(here)
    return changed
