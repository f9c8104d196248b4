"""Graph questions on diagrams: fixpoints of images and preimages; components by enumeration where they are small.

Sources: Bianco & de Alfaro (1995) for prob0/prob1 of MDPs; Xie & Beerel (2000) for bottom components by pivots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from time import perf_counter
from typing import Protocol

import numpy as np

from symcheck.dd.closing import close
from symcheck.dd.manager import Bdd
from symcheck.dd.odd import Odd
from symcheck.engines.diagrams import Diagrams, Step
from symcheck.engines.symbolic_sets import SymbolicSet
from symcheck.engines.symbolic_system import Owner as SystemOwner
from symcheck.engines.symbolic_system import SymbolicSystem
from symcheck.numerics import graph
from symcheck.numerics.matrix import Bools, Int32s
from symcheck.records import dataclass, field

__all__ = ["Owner", "SymbolicGraph"]

PIVOTS = 12
"""Bottom components are looked for with so many pivots on diagrams before the rows of what is left are enumerated."""

PATIENCE = 0.25
"""Seconds that a search on diagrams gets before it is done on rows, where these are few."""

FEW_ROWS = 10_000_000
"""Transitions that are few enough for that, unless the engine has a limit of its own."""

REMEMBERED = 4
"""Results of backward searches that are kept."""


class TooSlowError(Exception):
    """A search on diagrams takes long; never leaves this module."""


class Owner(SystemOwner, Protocol):
    """What graph questions ask of their engine."""

    @property
    def transitions(self) -> int:
        """Number of transitions."""
        ...

    @property
    def all(self) -> SymbolicSet:
        """Every reachable state."""
        ...

    def lowest(self, states: Bdd) -> Bdd:
        """The state of the lowest number of a set that is not empty, as a set."""
        ...

    def to_bools(self, states: SymbolicSet) -> Bools:
        """Membership of each state, in index order."""
        ...

    def valuations(self, states: SymbolicSet) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order."""
        ...

    def system(self, states: SymbolicSet) -> SymbolicSystem:
        """The equations over some states."""
        ...


@dataclass(frozen=True, eq=False)
class SymbolicGraph:
    """See `symcheck.engines.base.Graph`. `observer` is told of each set on the way to a fixpoint, and what it is."""

    engine: Owner = field(repr=False)
    observer: Callable[[str, Bdd], None] | None = field(default=None, repr=False)

    @property
    def _d(self) -> Diagrams:
        return self.engine.diagrams

    def _set(self, bdd: Bdd) -> SymbolicSet:
        return SymbolicSet(self._d, bdd)

    def _tell(self, what: str, states: Bdd) -> None:
        if self.observer is not None:
            self.observer(what, states)

    # on rows, where diagrams are slow

    @cached_property
    def _affordable(self) -> bool:
        limit = self.engine.rows_limit
        return self.observer is None and self.engine.transitions <= (FEW_ROWS if limit is None else min(limit, FEW_ROWS))

    @cached_property
    def _rows(self) -> graph.Incidence:
        return graph.Incidence(self.engine.system(self.engine.all).matrix)

    def _answer(self, on_diagrams: Callable[[float | None], Bdd], on_rows: Callable[[graph.Incidence], Bools]) -> SymbolicSet:
        """An answer found on diagrams (which get a time to give up at), or else on rows."""
        if "_rows" not in vars(self):
            try:
                return self._set(on_diagrams(perf_counter() + PATIENCE if self._affordable else None))
            except TooSlowError:
                pass
        return self._set(self._d.odd.collapse(on_rows(self._rows)))

    @staticmethod
    def _check(deadline: float | None) -> None:
        if deadline is not None and perf_counter() > deadline:
            raise TooSlowError

    # steps and closures

    def _before(self, states: Bdd) -> Bdd:
        """Reachable states with a transition into the set."""
        d = self._d
        return (d.union([step.preimage(states) for step in d.steps]) & d.states) | (d.loops & states)

    def _close(self, start: Bdd, *, forward: bool, within: Bdd, deadline: float | None = None) -> Bdd:
        """The least set with `start` and what steps (forward or backward) add to it `within` a set."""
        if not start or within <= start:  # nothing to begin with, or nothing to add
            return start
        if self.observer is None:
            closed = close(self._d.closure(forward), start, within, deadline)
            if closed is not None:
                return closed
            self._check(deadline)
        return self._in_turns(start, forward, within, deadline)

    def _in_turns(self, start: Bdd, forward: bool, within: Bdd, deadline: float | None) -> Bdd:
        """The same, told step by step: steps take turns, each on what is new since its last turn."""
        steps = [step for level in self._d.levels for step in level]
        done = [self._d.manager.false] * len(steps)
        states = start
        while True:
            before = states
            for number, step in enumerate(steps):
                self._check(deadline)
                fresh = states - done[number]
                if fresh:
                    done[number] = states
                    states = states | ((step.image(fresh) if forward else step.preimage(fresh)) & within)
            if states == before:
                return states
            self._tell("closure", states)

    @cached_property
    def _known(self) -> dict[tuple[Bdd, Bdd], Bdd]:
        """The last results of `_backward`: prob0 and prob1 of one formula ask the same."""
        return {}

    def _backward(self, target: Bdd, through: Bdd, deadline: float | None = None) -> Bdd:
        """States with a path into `target` whose states before are in `through`; with `target` itself."""
        if (target, through) not in self._known:
            if len(self._known) >= REMEMBERED:
                self._known.pop(next(iter(self._known)))
            self._known[target, through] = self._close(target, forward=False, within=through, deadline=deadline)
        return self._known[target, through]

    def reachable(self, sources: Bdd) -> Bdd:
        """All states that paths from `sources` lead to."""
        return self._close(sources, forward=True, within=self._d.manager.true)

    def predecessors(self, states: SymbolicSet) -> SymbolicSet:
        """States with some transition (of some choice) into the set."""
        return self._set(self._before(states.bdd))

    def all_successors_in(self, states: SymbolicSet) -> SymbolicSet:
        """States all of whose transitions (of all choices) lead into the set."""
        return ~self.predecessors(~states)

    def exists_until(self, left: SymbolicSet, right: SymbolicSet) -> SymbolicSet:
        """E [ left U right ]."""
        to_bools = self.engine.to_bools
        return self._answer(
            lambda deadline: self._backward(right.bdd, left.bdd, deadline),
            lambda rows: graph.backward_reachable(rows, to_bools(right), to_bools(left)),
        )

    def exists_globally(self, states: SymbolicSet) -> SymbolicSet:
        """E [ G states ]."""
        inside = states.bdd
        while True:
            smaller = inside & self._before(inside)
            if smaller == inside:
                return self._set(inside)
            inside = smaller

    # probability 0 and 1

    @property
    def _guards(self) -> tuple[Bdd, ...]:
        return self._d.guards if self._d.guards is not None else (self._d.states,)

    def _slots_before(self, states: Bdd) -> list[Bdd]:
        """Per slot: the states whose choice may lead into the set."""
        return [self._d.whole.preimage(states, relation) for relation in self._d.slot_relations]

    def _slots_within(self, states: Bdd) -> list[Bdd]:
        """Per slot: the states whose choice surely leads into the set."""
        outside = self._slots_before(self._d.states - states)
        return [guard - out for guard, out in zip(self._guards, outside, strict=True)]

    def prob0(self, left: SymbolicSet, right: SymbolicSet, direction: str | None) -> SymbolicSet:
        """States whose (min/max) probability of left U right is 0."""
        if direction != "min" or self._d.guards is None:
            return ~self.exists_until(left, right)
        to_bools = self.engine.to_bools
        return self._answer(
            lambda deadline: self._d.states - self._unavoidable(left.bdd, right.bdd, deadline),
            lambda rows: graph.prob0e(rows, to_bools(left), to_bools(right)),
        )

    def _unavoidable(self, left: Bdd, right: Bdd, deadline: float | None) -> Bdd:
        """States from where all strategies have a positive probability of left U right."""
        reach = right
        while reach:
            self._check(deadline)
            before = self._slots_before(reach)
            escape = self._d.union([guard - b for guard, b in zip(self._guards, before, strict=True)])
            more = reach | (left & self._d.union(before) - escape)
            if more == reach:
                return reach
            reach = more
            self._tell("every strategy reaches", reach)
        return reach

    def prob1(self, left: SymbolicSet, right: SymbolicSet, direction: str | None) -> SymbolicSet:
        """States whose (min/max) probability of left U right is 1."""
        if direction != "max" or self._d.guards is None:
            # Whoever can get to where it may be missed for ever, before it is reached, may miss it.
            return ~self.exists_until(left - right, self.prob0(left, right, direction))
        to_bools = self.engine.to_bools
        return self._answer(
            lambda deadline: self._almost_sure(left.bdd, right.bdd, deadline),
            lambda rows: graph.prob1e(rows, to_bools(left), to_bools(right)),
        )

    def _almost_sure(self, left: Bdd, right: Bdd, deadline: float | None) -> Bdd:
        """States from where some strategy has probability 1 of left U right."""
        candidates = self._backward(right, left, deadline)
        if not self._before(self._d.states - candidates) & (candidates - right):
            return candidates  # whatever is chosen, there is a way on: sooner or later it is taken
        while candidates:
            self._tell("candidates", candidates)
            sure = self._surely_within(candidates, left, right, deadline)
            if sure == candidates:
                return sure
            candidates = sure
        return candidates

    def _surely_within(self, candidates: Bdd, left: Bdd, right: Bdd, deadline: float | None) -> Bdd:
        """States with a path into `right`, in `left` before, by choices that surely stay within `candidates`."""
        within = [w & left for w in self._slots_within(candidates)]
        sure = fresh = right
        while fresh:
            self._check(deadline)
            before = self._slots_before(fresh)
            fresh = self._d.union([w & b for w, b in zip(within, before, strict=True)]) - sure
            sure = sure | fresh
            self._tell("sure", sure)
        return sure

    # components

    @cached_property
    def _absorbing(self) -> Bdd:
        """States whose only successor is themselves."""
        moving = [step.relation - self._unchanged(step) for step in self._d.steps]
        moves = self._d.union([m.exists(s.transition.columns) for m, s in zip(moving, self._d.steps, strict=True)])
        return self._d.states - moves

    def _unchanged(self, step: Step) -> Bdd:
        core = self._d.manager.core
        pairs = [core.literal(row).equivalent(core.literal(column)) for row, column in step.transition.pairs]
        return self._d.manager.conjunction(pairs)

    def bsccs(self) -> Iterator[SymbolicSet]:
        """Bottom strongly connected components."""
        d = self._d
        left = d.states
        if self._absorbing:
            yield from self._singletons(self._absorbing)
            left = left - self._backward(self._absorbing, left)
        inside = left
        for _ in range(PIVOTS):
            if not left:
                return
            pivot = self.engine.lowest(inside)
            ahead = self.reachable(pivot)
            back = self._backward(pivot, ahead)
            if ahead == back:
                yield self._set(ahead)
                left = left - self._backward(ahead, left)
                inside = left
            else:
                left = left - self._backward(pivot, left)
                inside = ahead - back
        yield from self._enumerated_bsccs(left)

    def _enumerated_bsccs(self, left: Bdd) -> Iterator[SymbolicSet]:
        """Of a set that nothing leaves but into itself."""
        if not left:
            return
        part = self._part(left)
        for states in graph.bsccs(part.matrix):
            yield self._numbered(part.states.odd, states)

    def _part(self, states: Bdd) -> SymbolicSystem:
        return self.engine.system(self._set(states))

    def _singletons(self, states: Bdd) -> Iterator[SymbolicSet]:
        odd = Odd(self._d.manager, states, self._d.rows)
        for number in range(odd.count):
            yield self._numbered(odd, np.array([number], np.int32))

    def _numbered(self, odd: Odd, states: Int32s) -> SymbolicSet:
        """The set of the members with these numbers (ascending)."""
        bits = odd.unrank(states.astype(np.int64))
        return self._set(self._d.manager.bdd_from_rows(self._d.rows, bits))

    def end_components(self, within: SymbolicSet) -> Iterator[SymbolicSet]:
        """Maximal end components of the states `within`."""
        part, found = self._end_components(within.bdd)
        if part is None:
            return
        order = np.argsort(found.of, kind="stable").astype(np.int32)
        start = np.searchsorted(found.of[order], np.arange(found.count + 1))
        for c in range(found.count):
            yield self._numbered(part.states.odd, order[start[c] : start[c + 1]])

    def _end_components(self, within: Bdd) -> tuple[SymbolicSystem, graph.EndComponents] | tuple[None, graph.EndComponents]:
        """End components by enumeration of the states that can stay in `within` for ever."""
        stay = within
        while True:
            smaller = stay & self._d.union(self._slots_within(stay))
            if smaller == stay:
                break
            stay = smaller
        if not stay:
            return None, graph.EndComponents(np.empty(0, np.int32), np.empty(0, bool), 0)
        part = self._part(stay)
        inside = part.into(~part.states) == 0
        return part, graph.maximal_end_components(part.matrix, np.ones(part.n, bool), inside)

    def accepting_end_components(self, pairs: Sequence[tuple[SymbolicSet, Sequence[SymbolicSet]]]) -> SymbolicSet:
        """States in an end component that, for some pair (avoid, visits), avoids `avoid` and meets every set in `visits`."""
        accepted = []
        for avoid, visits in pairs:
            part, found = self._end_components(self._d.states - avoid.bdd)
            if part is None:
                continue
            odd = part.states.odd
            good = np.ones(found.count, bool)
            for visit in visits:
                met = found.of[odd.expand(visit.bdd)]
                good &= np.bincount(met[met >= 0], minlength=found.count) > 0
            member: Bools = (found.of >= 0) & np.append(good, False)[found.of]
            accepted.append(odd.collapse(member))
        return self._set(self._d.union(accepted))

    # paths

    def witness(self, left: SymbolicSet, right: SymbolicSet) -> Sequence[Mapping[str, int | bool]] | None:
        """A shortest path from an initial state that satisfies left U right, as states; None if there is none."""
        d = self._d
        layers = [d.initial]
        seen = d.initial
        while not layers[-1] & right.bdd:
            following = d.union([step.image(layers[-1] & left.bdd) for step in d.steps]) - seen
            if not following:
                return None
            seen = seen | following
            layers.append(following)
        path = [self.engine.lowest(layers[-1] & right.bdd)]
        for layer in layers[-2::-1]:
            path.append(self.engine.lowest(self._before(path[-1]) & layer & left.bdd))
        names = [v.name for v in self.engine.model.variables]
        return [dict(zip(names, next(iter(self.engine.valuations(self._set(s)))), strict=True)) for s in reversed(path)]
