"""The locations of a timed automaton, the edges between them, and the zones that are reached."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import field, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from symcheck.engines.zones.federation import (
    INFINITE,
    Atom,
    close,
    complement,
    constrained,
    distinct,
    empty,
    everything,
    future,
    includes,
    intersection,
    point,
    reset,
    union,
    zone_of,
)
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Int64s
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.interpreter import State, choices
from symcheck.semantics.model import BoundModel, Value
from symcheck.semantics.state_faults import describe_state
from symcheck.semantics.timed.constraints import constraint
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator, connect
from symcheck.syntax.traversal import names

__all__ = [
    "Edge",
    "Outcome",
    "TimedGraph",
    "explore_zones",
    "is_non_zeno",
    "time_passes_in_cycles",
    "unbounded",
]


class Outcome(NamedTuple):
    """What may follow an edge: its probability, the clocks that are set, the next location."""

    probability: Value
    resets: Mapping[int, int]
    target: int


class Edge(NamedTuple):
    """A choice of a location: where it is enabled, and what may follow."""

    guard: Int64s
    outcomes: tuple[Outcome, ...]


@dataclass(eq=False)
class TimedGraph:
    """A timed automaton with its discrete variables evaluated.

    Clocks are numbered from 1 in the order of their declaration; behind them are those that a
    property adds.

    Attributes:
        model: the automaton.
        unit: the time of which all constants are multiples; zones count it.
        further: the number of clocks that a property adds.
        locations: the values of the variables, 0 for clocks.
        invariants: per location the zone in which time passes.
        edges: per location.
        reached: per location the zones that are reached.
    """

    model: BoundModel = field(repr=False)
    unit: Fraction
    further: int = 0
    locations: list[State] = field(default_factory=list, repr=False)
    invariants: list[Int64s] = field(default_factory=list, repr=False)
    edges: list[list[Edge]] = field(default_factory=list, repr=False)
    reached: list[Int64s] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        self.clock_of: dict[str, int] = {}
        for v in self.model.variables:
            if v.clock:
                self.clock_of[v.name] = len(self.clock_of) + 1
        self.clocks = len(self.clock_of) + 1 + self.further
        self._reading: dict[int, tuple[Expression, bool]] = {}  # by identity: hashes take longer

    def holds(self, condition: Expression, location: int) -> Int64s:
        """The values of the clocks with which a condition holds in a location."""
        return self.holds_at(condition, self.locations[location])

    def holds_at(self, condition: Expression, state: State) -> Int64s:
        """As `holds`, with the values of the variables."""
        values = {
            v.name: x for v, x in zip(self.model.variables, state, strict=True) if not v.clock
        }
        return self._holds(condition, values)

    def _reads_clocks(self, condition: Expression) -> bool:
        """Whether a condition reads clocks."""
        known = self._reading.get(id(condition))
        if known is None or known[0] is not condition:
            known = condition, not names(condition).isdisjoint(self.clock_of)
            self._reading[id(condition)] = known
        return known[1]

    def _holds(self, condition: Expression, values: Mapping[str, Value]) -> Int64s:
        if not self._reads_clocks(condition):
            is_true = evaluate(condition, values, exact=True)
            return everything(self.clocks) if is_true else empty(self.clocks)
        match condition:
            case Unary(UnaryOperator.NOT, operand):
                return complement(self._holds(operand, values))
            case Binary(operator, left, right) if operator.is_logical:
                return connect(
                    operator,
                    self._holds(left, values),
                    self._holds(right, values),
                    conjunction=intersection,
                    disjunction=union,
                    negation=complement,
                )
            case Binary():
                found = constraint(condition, self.clock_of.keys())
                assert found is not None
                i = self.clock_of[found.clock]
                j = 0 if found.other is None else self.clock_of[found.other]
                bound = Fraction(evaluate(found.bound, values, exact=True)) / self.unit
                return self.compared(i, j, found.operator, int(bound))
            case Conditional(choice, then, otherwise):
                where = self._holds(choice, values)
                return union(
                    intersection(where, self._holds(then, values)),
                    intersection(complement(where), self._holds(otherwise, values)),
                )
            case _:
                raise AssertionError("a clock outside of comparisons")

    def compared(self, i: int, j: int, operator: Operator, bound: int) -> Int64s:
        """The values for which x_i - x_j compares in this way with a number of units."""
        upper, lower = (i, j, 2 * bound), (j, i, -2 * bound)
        match operator:
            case Operator.LT:
                return zone_of(self.clocks, upper)
            case Operator.LE:
                return zone_of(self.clocks, (i, j, 2 * bound + 1))
            case Operator.GT:
                return zone_of(self.clocks, lower)
            case Operator.GE:
                return zone_of(self.clocks, (j, i, 1 - 2 * bound))
            case Operator.EQ:
                return zone_of(self.clocks, (i, j, 2 * bound + 1), (j, i, 1 - 2 * bound))
            case _:
                return np.concatenate([zone_of(self.clocks, upper), zone_of(self.clocks, lower)])

    def describe(self, location: int, zone: Int64s) -> str:
        """A state of a zone, for messages."""
        times, variables = iter(point(zone)), self.model.variables
        pairs = zip(variables, self.locations[location], strict=True)
        return describe_state(
            variables, [next(times) * self.unit if v.clock else x for v, x in pairs]
        )


def unbounded(zones: Int64s) -> Bools:
    """Which of the zones time does not leave."""
    return np.asarray((zones[:, 1:, 0] >= INFINITE // 2).all(axis=1))


def is_non_zeno(automaton: BoundModel, unit: Fraction, most: int) -> bool:
    """Whether it is plain that a unit of time passes in each cycle of locations.

    So it is if each cycle has an edge that sets some clock to 0, and one whose guard requires that
    this clock is at least the unit.

    Args:
        automaton: a timed automaton.
        unit: the time of which all constants are multiples.
        most: the answer is False if there are more locations.

    Source: Tripakis, Yovine & Bouajjani, Checking timed Büchi automata emptiness efficiently, FMSD
    26 (2005), strong non-Zenoness.
    """
    graph = TimedGraph(automaton, unit)
    exploration = _Exploration(graph, {}, set())
    exploration.start()
    number = 0
    while number < len(graph.locations):
        if number >= most:
            return False
        exploration.expand(number)
        number += 1
    return time_passes_in_cycles(graph)


def time_passes_in_cycles(graph: TimedGraph) -> bool:
    """As `is_non_zeno`, of an explored automaton."""
    arcs = [
        _Arc(
            source,
            o.target,
            frozenset(c for c, value in o.resets.items() if value == 0),
            frozenset(np.flatnonzero((edge.guard[:, 0, :] <= -1).all(axis=0)).tolist()),
        )
        for source, edges in enumerate(graph.edges)
        for edge in edges
        for o in edge.outcomes
    ]
    return _passes(arcs, len(graph.locations))


class _Arc(NamedTuple):
    source: int
    target: int
    resets: frozenset[int]
    waits: frozenset[int]


def _passes(arcs: list[_Arc], locations: int) -> bool:
    if not arcs:
        return True
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = [a.source for a in arcs], [a.target for a in arcs]
    matrix = coo_array((np.ones(len(arcs), np.int8), ends), (locations, locations))
    component = connected_components(matrix, connection="strong")[1].tolist()
    by_component: dict[int, list[_Arc]] = {}
    for arc in arcs:
        if component[arc.source] == component[arc.target]:
            by_component.setdefault(component[arc.source], []).append(arc)
    return all(_passes_in(own, locations) for own in by_component.values())


def _passes_in(arcs: list[_Arc], locations: int) -> bool:
    """Whether a clock excuses the cycles of a component that set it and wait for it, and others
    excuse the rest.
    """
    for clock in frozenset[int]().union(*(a.resets for a in arcs)):
        keeping = [a for a in arcs if clock not in a.resets]
        hurried = [a for a in arcs if clock not in a.waits]
        if len(hurried) < len(arcs) and all(
            _passes(part, locations) for part in (keeping, hurried)
        ):
            return True
    return False


def explore_zones(graph: TimedGraph, limits: Mapping[int, int], atoms: set[Atom]) -> None:
    """Find the locations and zones that are reached, and what stops time.

    Args:
        graph: filled by this.
        limits: per clock the largest constant that it is compared with.
        atoms: the diagonal constraints.

    Raises:
        UnsupportedError: an invariant is no zone.

    Source: Bengtsson & Yi, On clock difference constraints and termination in reachability
    analysis of timed automata, ICFEM 2003.
    """
    _Exploration(graph, limits, atoms).run()


class _Exploration:
    def __init__(self, graph: TimedGraph, limits: Mapping[int, int], atoms: set[Atom]) -> None:
        self.graph, model = graph, graph.model
        self.limits = np.array([limits.get(i, 0) for i in range(graph.clocks)], np.int64)
        self.atoms = sorted(atoms)
        self.guards: dict[int, Expression] = {}
        events = []
        for event in model.events:
            participants = []
            for commands in event.participants:
                made = []
                for command in commands:
                    new = replace(command, guard=_may_hold(command.guard, graph, True))
                    self.guards[id(new)] = command.guard
                    made.append(new)
                participants.append(tuple(made))
            events.append(replace(event, participants=tuple(participants)))
        variables = tuple(replace(v, low=-1, high=None) if v.clock else v for v in model.variables)
        self.discrete = replace(model, events=tuple(events), variables=variables, rewards=())
        self.is_clock = [v.clock for v in model.variables]
        self.number: dict[State, int] = {}
        invariant: Expression = Literal(True, Type.BOOL)
        for module in model.modules:
            if module.invariant is not None:
                invariant = Binary(Operator.AND, invariant, module.invariant)
        self.invariant = invariant

    def location(self, state: State) -> int:
        found = self.number.get(state)
        if found is not None:
            return found
        graph = self.graph
        self.number[state] = number = len(graph.locations)
        graph.locations.append(state)
        zones = graph.holds_at(self.invariant, state)
        if len(zones) > 1:
            raise UnsupportedError(
                "an invariant with disjunctions of clock constraints is not supported by zones",
                note=f"in state {describe_state(graph.model.variables, state)}",
            )
        graph.invariants.append(zones)
        graph.edges.append([])
        graph.reached.append(empty(graph.clocks))
        return number

    def expand(self, number: int) -> None:
        """Find the edges of a location."""
        graph = self.graph
        state = graph.locations[number]
        start = tuple(-1 if c else x for c, x in zip(self.is_clock, state, strict=True))
        for choice in choices(self.discrete, start):
            guard = everything(graph.clocks)
            for command in choice.commands:
                guard = intersection(guard, graph.holds(self.guards[id(command)], number))
            if not len(guard):
                continue
            merged: dict[tuple[tuple[tuple[int, int], ...], int], Value] = defaultdict(Fraction)
            for probability, after in choice.branches:
                values = [x for c, x in zip(self.is_clock, after, strict=True) if c]
                resets = tuple((i, self.units(x)) for i, x in enumerate(values, 1) if x >= 0)
                target = self.location(
                    tuple(0 if c else x for c, x in zip(self.is_clock, after, strict=True))
                )
                merged[resets, target] += probability
            outcomes = tuple(Outcome(p, dict(r), t) for (r, t), p in merged.items())
            stays = len(outcomes) == 1 and outcomes[0][1:] == ({}, number)
            if stays and np.array_equal(graph.invariants[number], everything(graph.clocks)):
                continue  # it only lets steps happen at one instant, where time may pass
            graph.edges[number].append(Edge(guard, outcomes))

    def units(self, value: int) -> int:
        return int(Fraction(value) / self.graph.unit)

    def start(self) -> int:
        """The initial location."""
        variables = self.graph.model.variables
        return self.location(
            tuple(0 if v.clock or v.initial is None else v.initial for v in variables)
        )

    def run(self) -> None:
        graph = self.graph
        start = self.start()
        origin = zone_of(graph.clocks, *((i, 0, 1) for i in range(1, graph.clocks)))
        waiting = [(start, origin)]
        expanded = set[int]()
        while waiting:
            number, entered = waiting.pop()
            zones = self.delayed(number, entered)
            old = graph.reached[number]
            if len(old):
                zones = zones[~includes(old, zones).any(axis=0)]
            if not len(zones):
                continue
            graph.reached[number] = union(old, zones)
            if number not in expanded:
                expanded.add(number)
                self.expand(number)
            for edge in graph.edges[number]:
                taken = intersection(zones, edge.guard)
                if not len(taken):
                    continue
                waiting += [(o.target, reset(taken, o.resets)) for o in edge.outcomes]

    def delayed(self, number: int, zones: Int64s) -> Int64s:
        """The zones after any time, in a finite number of forms."""
        invariant = self.graph.invariants[number]
        later = intersection(future(intersection(zones, invariant)), invariant)
        return distinct(np.concatenate([self.abstract(later), self.abstract(zones)]))

    def abstract(self, zones: Int64s) -> Int64s:
        """The zones without bounds beyond the constants that a clock is compared with."""
        pieces: list[tuple[Int64s, list[Atom]]] = [(zones, [])]
        for i, j, code in self.atoms:
            pieces = [
                (part, [*kept, atom])
                for zone, kept in pieces
                for atom in ((i, j, code), (j, i, 1 - code))
                if len(part := constrained(zone, atom))
            ]
        results = [empty(self.graph.clocks)]
        for zone, kept in pieces:
            zone = zone.copy()
            upper = 2 * self.limits[:, None] + 1
            lower = -2 * self.limits[None, :]
            off = ~np.eye(zone.shape[1], dtype=bool)
            big = off & (zone > upper)
            zone[big] = INFINITE
            small = off & (zone < lower)
            zone = np.where(small, np.broadcast_to(lower, zone.shape), zone)
            results.append(constrained(close(zone), *kept))
        return np.concatenate(results)


def _may_hold(condition: Expression, graph: TimedGraph, holds: bool) -> Expression:
    """A condition without clocks that holds (or else fails) wherever this one may."""
    if not names(condition) & graph.clock_of.keys():
        return condition
    match condition:
        case Unary(UnaryOperator.NOT, operand):
            return replace(condition, operand=_may_hold(operand, graph, not holds))
        case Binary(Operator.AND | Operator.OR, left, right):
            return replace(
                condition,
                left=_may_hold(left, graph, holds),
                right=_may_hold(right, graph, holds),
            )
        case Binary(Operator.IMPLIES, left, right):
            return replace(
                condition,
                left=_may_hold(left, graph, not holds),
                right=_may_hold(right, graph, holds),
            )
        case _:
            return Literal(holds, Type.BOOL)
