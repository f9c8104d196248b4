"""The decision process over zones as a bound model, whose builder finds it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cached_property, partial

import numpy as np

from symcheck.engines.base import Engine, erased
from symcheck.engines.capabilities import HasRationalTwin
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.rational.explore import RationalModel, StateList
from symcheck.engines.zones.automaton import (
    TimedGraph,
    explore_zones,
    time_passes_in_cycles,
    unbounded,
)
from symcheck.engines.zones.backwards import (
    ZoneProcess,
    always_safe,
    can_go_on,
    most_probable,
    never_ending,
)
from symcheck.engines.zones.federation import (
    Atom,
    before,
    complement,
    everything,
    intersection,
    subtraction,
    union,
)
from symcheck.errors import Span, SymcheckError
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import StateLayout, StateTable
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import doubles, rationals
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.options import Options
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.semantics.model import BoundModel, Variable
from symcheck.semantics.timed.digital import common_unit, limits_of
from symcheck.semantics.timed.properties import OnZones, Reach
from symcheck.semantics.timed.stopped_time import Stop, time_stops
from symcheck.syntax.ast import Binary, Expression, Literal, ModelType, Name, Type
from symcheck.syntax.operators import Operator

__all__ = ["ZoneEngine", "zone_model"]


@dataclass(frozen=True)
class ZoneEngine(ExplicitEngine, HasRationalTwin):
    """The explicit engine on the decision process over zones.

    twin: the same process with rational probabilities.
    """

    twin: RationalModel | None = None

    def rational(self, *, strict: bool = False) -> Engine:  # noqa: ARG002
        """The same process in rational arithmetic, with the probabilities of the text."""
        assert self.twin is not None
        return erased(ExplicitEngine(self.twin, "exact"))


def zone_model(automaton: BoundModel, reach: Reach) -> BoundModel:
    """The model over zones on which a measure of a timed automaton is checked.

    Its states are numbers, of which those with the label "reached" are the last ones.
    """
    last = Variable("zone", Type.INT, 0, (1 << 31) - 1, 0, None)
    model = replace(
        automaton,
        type=ModelType.with_properties(has_choices=True),
        variables=(last,),
        modules=(),
        events=(),
        rewards=(),
        labels={},
        clocks=OnZones(automaton, reach.measure, reach.avoids),
    )
    search = _Search(automaton, reach)
    return replace(model, builder=partial(_built, search, model))


class _Search:
    """The process, found when it is first asked for."""

    def __init__(self, automaton: BoundModel, reach: Reach) -> None:
        self.automaton, self.reach = automaton, reach

    @cached_property
    def process(self) -> ZoneProcess:
        try:
            automaton = exactly_bound(self.automaton)
            return _process(automaton, self.reach)
        except SymcheckError:
            return _process(self.automaton, self.reach)


def _process(automaton: BoundModel, reach: Reach) -> ZoneProcess:
    """Explore the automaton, and search backwards from what a measure asks for."""
    path = reach.path
    assert path is not None
    window = path.window
    horizon = () if window.is_unbounded else (window.lower, window.upper or Fraction(0))
    conditions = (reach.left, reach.right)
    limits, atoms = limits_of(automaton, conditions)
    unit = common_unit([*(c for v in limits.values() for c in v), *horizon])
    further = 0 if window.is_unbounded else 1
    graph = TimedGraph(automaton, unit, further)
    now = graph.clocks - 1
    top = {graph.clock_of[n]: int(max(v, default=Fraction(0)) / unit) for n, v in limits.items()}
    top |= {now: int(max(horizon) / unit)} if horizon else {}
    diagonals: set[Atom] = set()
    for i, j, value in ((graph.clock_of[a], graph.clock_of[b], int(c / unit)) for a, b, c in atoms):
        diagonals |= {(i, j, 2 * value), (i, j, 2 * value + 1)}
    explore_zones(graph, top, diagonals)
    count = range(len(graph.locations))
    _check_time(graph, can_go_on(graph), Stop.TIMELOCK)
    left = [graph.holds(reach.left, k) for k in count]
    right = [graph.holds(reach.right, k) for k in count]
    beyond: Int64s | None = None
    if window.lower > 0 or window.lower_strict:
        operator = Operator.GT if window.lower_strict else Operator.GE
        since = graph.compared(now, 0, operator, int(window.lower / unit))
        right = [intersection(r, since) for r in right]
    if window.upper is not None:
        operator = Operator.LT if window.upper_strict else Operator.LE
        until = graph.compared(now, 0, operator, int(window.upper / unit))
        right, beyond = [intersection(r, until) for r in right], complement(until)
    if not reach.avoids:
        return most_probable(graph, left, right)
    passes = time_passes_in_cycles(graph)
    if not passes:
        whole = never_ending(graph, [everything(graph.clocks) for _ in count])
        _check_time(graph, whole, Stop.ZENO)
    outside = [complement(r) for r in right]
    failed = [subtraction(o, a) for o, a in zip(outside, left, strict=True)]
    if beyond is not None:
        ends = [beyond for _ in count]
    else:
        ends = (always_safe if passes else never_ending)(graph, outside)
    return most_probable(graph, outside, [union(f, e) for f, e in zip(failed, ends, strict=True)])


def _check_time(graph: TimedGraph, fine: list[Int64s], stop: Stop) -> None:
    """Raise ModelFault if a state is reached that is not fine."""
    for number, zones in enumerate(graph.reached):
        stuck = subtraction(zones, fine[number])
        if not len(stuck):
            continue
        if stop is Stop.TIMELOCK:
            ended = subtraction(stuck, before(graph.invariants[number]))
            stuck, stop = (ended, stop) if len(ended) else (stuck, Stop.LIMIT)
        raise time_stops(stop, graph.describe(number, stuck), _limit(graph, number, stuck))


def _limit(graph: TimedGraph, number: int, zones: Int64s) -> Span | None:
    """The invariant that time meets in a location, or that fails in the first of some zones."""
    found = None
    for module in graph.model.modules:
        if module.invariant is None:
            continue
        zone = graph.holds(module.invariant, number)
        if len(subtraction(zones[:1], before(zone))):
            return module.invariant.span
        if found is None and not unbounded(zone).any():
            found = module.invariant.span
    return found


def _built(search: _Search, model: BoundModel, options: Options) -> Engine:
    """The engine on the process that a search finds."""
    process = search.process
    groups = starts_of(np.bincount([r.state for r in process.rows], minlength=process.states))
    starts = starts_of(np.array([len(r.branches) for r in process.rows]))
    targets = np.array([s for r in process.rows for _, s in r.branches], np.int32)
    weights = rationals([p for r in process.rows for p, _ in r.branches])
    matrix = SparseMatrix(starts, targets, weights, process.states, groups)
    numbers = np.arange(process.states)
    layout = StateLayout.of(model.variables)
    table = StateTable(layout, layout.pack([numbers]))
    actions = np.full(matrix.rows, -1, np.int32)
    nothing = np.zeros(0, np.int64)
    first = np.zeros(1, np.int64)
    target: Expression = Binary(Operator.GE, Name("zone"), Literal(process.target, Type.INT))
    model = replace(model, labels={"reached": target}, builder=partial(_built, search, model))
    exact = RationalModel(
        replace(model, is_rational=True),
        StateList(tuple(table)),
        matrix,
        actions,
        first,
        nothing,
        [],
        [],
    )
    if options.exact:
        return erased(ExplicitEngine(exact, "exact"))
    explored = ExplicitModel(
        model, table, replace(matrix, data=doubles(weights)), actions, first, nothing, [], []
    )
    return erased(ZoneEngine(explored, twin=exact))
