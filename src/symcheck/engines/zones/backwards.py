"""Greatest probabilities of a timed automaton by backwards reachability.

From the zones of a target, the zones are found from which an edge leads into a zone that is known,
closed under the intersections that let several outcomes of an edge lead into known zones. On these
zones a finite decision process has the greatest probability of the automaton.
Source: Kwiatkowska, Norman, Sproston & Wang, Symbolic model checking for probabilistic timed
automata, Information and Computation 205 (2007).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symcheck.engines.zones.automaton import Edge, TimedGraph, unbounded
from symcheck.engines.zones.federation import (
    INFINITE,
    close,
    complement,
    constrained,
    empty,
    everything,
    includes,
    intersection,
    is_within,
    past,
    subtraction,
    time_predecessors,
    union,
    without_resets,
)
from symcheck.matrices.rows import Int64s
from symcheck.semantics.model import Value

__all__ = ["Row", "ZoneProcess", "always_safe", "can_go_on", "most_probable", "never_ending"]

_LOST = 1
_AIM = -1  # the last state, whose number is known at the end

Federations = Sequence[Int64s]
"""A federation per location."""


class Row(NamedTuple):
    """A choice of a symbolic state: probabilities and successors."""

    state: int
    branches: tuple[tuple[Value, int], ...]


class ZoneProcess(NamedTuple):
    """A decision process: state 0 is the first one, states from `target` on are in the target."""

    states: int
    target: int
    rows: tuple[Row, ...]


def can_go_on(graph: TimedGraph) -> list[Int64s]:
    """Per location the values with which time may pass for ever, or until a command is enabled."""
    result = []
    for number, edges in enumerate(graph.edges):
        inside = graph.invariants[number]
        ahead = [e.guard for e in edges]
        free = inside[unbounded(inside)]
        waiting = past(intersection(union(free, *ahead), inside))
        result.append(union(*ahead, intersection(waiting, inside)))
    return result


def _until(inside: Int64s, goal: Int64s, avoided: Int64s) -> Int64s:
    """The values from which time leads into a goal, or which are in it."""
    later = time_predecessors(intersection(goal, inside), avoided)
    return union(goal, intersection(later, inside))


def _before(edge: Edge, sets: Federations) -> list[Int64s]:
    """Per outcome the values from which it leads into the sets."""
    return [without_resets(sets[o.target], o.resets) for o in edge.outcomes]


def always_safe(graph: TimedGraph, safe: Federations) -> list[Int64s]:
    """As `never_ending`, if time passes in each cycle: it goes on for ever wherever steps do."""
    current = list(safe)
    ever = []
    for inside, zones in zip(graph.invariants, safe, strict=True):
        free = inside[unbounded(inside)]
        ever.append(subtraction(intersection(zones, free), past(complement(zones))))
    changed = set(range(len(current)))
    while changed:
        waiting, changed = changed, set()
        for number, edges in enumerate(graph.edges):
            if number not in waiting and not any(
                o.target in waiting for e in edges for o in e.outcomes
            ):
                continue
            goal = ever[number]
            for edge in edges:
                there = intersection(edge.guard, safe[number])
                for stays in _before(edge, current):
                    there = intersection(there, stays)
                goal = union(goal, there)
            new = _until(graph.invariants[number], goal, complement(safe[number]))
            if not is_within(current[number], new):
                current[number] = new
                changed.add(number)
    return current


def never_ending(graph: TimedGraph, safe: Federations) -> list[Int64s]:
    """Per location the values from which a strategy stays in safe states and lets time go on.

    It is the greatest set from which, within it, at least one unit of time passes with a positive
    probability again and again: almost surely, then, for ever.
    """
    clocks = graph.clocks
    current = list(safe)
    inside = [_with_clock(i) for i in graph.invariants]
    one_unit = constrained(everything(clocks + 1), (0, clocks, -1))
    edges = [[Edge(_with_clock(e.guard), e.outcomes) for e in es] for es in graph.edges]
    into: list[set[int]] = [set() for _ in edges]
    for number, own in enumerate(edges):
        for edge in own:
            for outcome in edge.outcomes:
                into[outcome.target].add(number)
    while True:
        lifted = [_with_clock(z) for z in current]
        left = [complement(z) for z in lifted]
        reaching = [empty(clocks + 1) for _ in current]
        waiting = deque(range(len(current)))
        queued = set(waiting)
        while waiting:
            number = waiting.popleft()
            queued.discard(number)
            goal = intersection(lifted[number], one_unit)
            for edge in edges[number]:
                there = intersection(edge.guard, lifted[number])
                for stays in _before(edge, lifted):
                    there = intersection(there, stays)
                if len(there):
                    some = union(*_before(edge, reaching))
                    goal = union(goal, intersection(there, some))
            new = _until(inside[number], goal, left[number])
            if not is_within(new, reaching[number]):
                reaching[number] = new
                for source in into[number] - queued:
                    waiting.append(source)
                    queued.add(source)
        following = [
            union(constrained(r, (clocks, 0, 1))[:, :clocks, :clocks].copy()) for r in reaching
        ]
        if all(is_within(old, new) for old, new in zip(current, following, strict=True)):
            return following
        current = following


def _with_clock(zones: Int64s) -> Int64s:
    """The same values, and any value of one more clock."""
    m, n, _ = zones.shape
    wider = np.repeat(everything(n + 1), m, axis=0)
    wider[:, :n, :n] = zones
    wider[:, n, :n] = INFINITE
    wider[:, :n, n] = zones[:, :, 0]
    return wider


def most_probable(graph: TimedGraph, allowed: Federations, target: Federations) -> ZoneProcess:
    """The decision process with the greatest probability of reaching a target.

    Args:
        graph: the automaton, explored.
        allowed: per location the values that paths may have before the target.
        target: per location the values in the target.
    """
    return _Search(graph, allowed, target).run()


class _Piece(NamedTuple):
    """Where an outcome of an edge leads into a symbolic state."""

    outcome: int
    zone: Int64s
    into: int


class _Search:
    def __init__(self, graph: TimedGraph, allowed: Federations, target: Federations) -> None:
        self.graph = graph
        self.within = [union(a, t) for a, t in zip(allowed, target, strict=True)]
        self.avoided = [complement(w) for w in self.within]
        self.number: dict[tuple[int, bytes], int] = {}
        self.states: list[tuple[int, Int64s]] = []
        self.pieces: list[list[list[_Piece]]] = [[[] for _ in es] for es in graph.edges]
        # Per edge, by the outcomes that lead into known states: the zones, by their bytes.
        self.cells: list[list[dict[frozenset[int], dict[bytes, Int64s]]]] = [
            [{} for _ in es] for es in graph.edges
        ]
        self.into: list[list[tuple[int, int, int]]] = [[] for _ in graph.edges]
        for number, edges in enumerate(graph.edges):
            for e, edge in enumerate(edges):
                for o, outcome in enumerate(edge.outcomes):
                    self.into[outcome.target].append((number, e, o))
        self.guards = [
            [intersection(e.guard, w) for e in es]
            for es, w in zip(graph.edges, self.within, strict=True)
        ]
        self.waiting: deque[int] = deque()
        for number, zones in enumerate(target):
            for k in range(len(zones)):
                self.add(number, zones[k : k + 1])
        self.targets = len(self.states)

    def add(self, location: int, zone: Int64s) -> None:
        """A symbolic state, unless no value of it is reached."""
        key = location, zone.tobytes()
        if key in self.number:
            return
        reached = self.graph.reached[location]
        if not len(reached) or not len(intersection(zone, reached)):
            return
        self.number[key] = len(self.states)
        self.states.append((location, zone))
        self.waiting.append(len(self.states) - 1)

    def run(self) -> ZoneProcess:
        graph = self.graph
        origin = constrained(everything(graph.clocks), *((i, 0, 1) for i in range(1, graph.clocks)))
        first: list[int] = []
        while self.waiting:
            state = self.waiting.popleft()
            location, zone = self.states[state]
            inside = graph.invariants[location]
            earlier = _until(
                inside, intersection(zone, self.within[location]), self.avoided[location]
            )
            if location == 0 and includes(earlier, origin).any():
                first.append(state)
            for number, e, o in self.into[location]:
                edge = graph.edges[number][e]
                zones = without_resets(earlier, edge.outcomes[o].resets)
                zones = intersection(zones, self.guards[number][e])
                for k in range(len(zones)):
                    self.piece(number, e, o, zones[k : k + 1], state)
        return self.process(first)

    def piece(self, number: int, e: int, o: int, zone: Int64s, state: int) -> None:
        """Note where an outcome leads into a state, and what it has in common with others."""
        self.pieces[number][e].append(_Piece(o, zone, state))
        self.add(number, zone)
        if len(self.graph.edges[number][e].outcomes) == 1:
            return
        cells = self.cells[number][e]
        new = [(frozenset([o]), zone)]
        while new:
            outcomes, part = new.pop()
            own = cells.setdefault(outcomes, {})
            if part.tobytes() in own:
                continue
            own[part.tobytes()] = part
            self.add(number, part)
            for others in [k for k in cells if not k & outcomes]:
                common = close(np.minimum(np.concatenate([*cells[others].values()]), part))
                new += [(outcomes | others, common[k : k + 1]) for k in range(len(common))]

    def process(self, first: list[int]) -> ZoneProcess:
        """The decision process on the symbolic states that were found.

        Where an outcome leads into several states, the strategy may choose the best one.
        """
        count, targets = len(self.states), self.targets
        # The first state, one from which the target is not reached, those that were found outside
        # of the target, choices among them, and the target.
        first_choice = 2 + count - targets
        chosen: dict[tuple[int, ...], int] = {}

        def name(state: int) -> int:
            return _AIM if state < targets else 2 + state - targets

        def best(into: list[int]) -> int:
            """The state that chooses among some states; that which is lost if there are none."""
            named = tuple(sorted({name(s) for s in into}))
            if _AIM in named or len(named) == 1:
                return named[0]
            return chosen.setdefault(named, first_choice + len(chosen)) if named else _LOST

        rows = [Row(0, ((1, name(s)),)) for s in first]
        by_location: dict[int, list[int]] = {}
        for state in range(targets, count):
            by_location.setdefault(self.states[state][0], []).append(state)
        for location, states in by_location.items():
            zones = np.concatenate([self.states[s][1] for s in states])
            for e, edge in enumerate(self.graph.edges[location]):
                pieces = self.pieces[location][e]
                if not pieces:
                    continue
                inside = includes(np.concatenate([p.zone for p in pieces]), zones)
                for k in np.flatnonzero(inside.any(axis=0)).tolist():
                    into: list[list[int]] = [[] for _ in edge.outcomes]
                    for i in np.flatnonzero(inside[:, k]).tolist():
                        into[pieces[i].outcome].append(pieces[i].into)
                    merged: dict[int, Value] = {}
                    for outcome, found in zip(edge.outcomes, into, strict=True):
                        after = best(found)
                        merged[after] = merged.get(after, 0) + outcome.probability
                    branches = tuple((p, s) for s, p in sorted(merged.items()))
                    rows.append(Row(name(states[k]), branches))
        rows += [Row(c, ((1, s),)) for into, c in chosen.items() for s in into]
        aim = first_choice + len(chosen)
        rows = [Row(r.state, tuple((p, s % (aim + 1)) for p, s in r.branches)) for r in rows]
        rows += [Row(aim, ((1, aim),))]
        rows += [Row(s, ((1, _LOST),)) for s in set(range(aim)) - {r.state for r in rows}]
        return ZoneProcess(aim + 1, aim, tuple(sorted(set(rows), key=lambda r: r.state)))
