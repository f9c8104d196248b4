"""Strong components and end components on diagrams, enumerated if they are small.

Source: Xie & Beerel (2000) for bottom components by pivots.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from symcheck.dd.manager import Bdd
from symcheck.dd.odd import Odd
from symcheck.engines import tuning
from symcheck.engines.base import SystemOf
from symcheck.engines.symbolic.diagrams import Diagrams, TransitionPart
from symcheck.engines.symbolic.sets import SymbolicOwner, SymbolicSet, SymbolicValues
from symcheck.engines.symbolic.steps import TransitionGraph
from symcheck.matrices.rows import Bools, Int32s
from symcheck.numerics import graph

__all__ = ["Components"]

System = SystemOf[SymbolicSet, SymbolicValues]


@dataclass(frozen=True, eq=False)
class Components:
    """Strong components and end components of a model."""

    engine: SymbolicOwner = field(repr=False)
    observer: Callable[[str, Bdd], None] | None = field(default=None, repr=False)

    @property
    def _d(self) -> Diagrams:
        return self.engine.diagrams

    @cached_property
    def steps(self) -> TransitionGraph:
        """Images, preimages and closures; `observer` is told of each set on the way."""
        return TransitionGraph(self._d, self.observer)

    def _set(self, bdd: Bdd) -> SymbolicSet:
        return SymbolicSet(self._d, bdd)

    @cached_property
    def _absorbing(self) -> Bdd:
        """States whose only successor is themselves."""
        moving = [step.relation - self._unchanged(step) for step in self._d.steps]
        moves = self._d.union(
            [m.exists(s.transition.columns) for m, s in zip(moving, self._d.steps, strict=True)]
        )
        return self._d.states - moves

    def _unchanged(self, step: TransitionPart) -> Bdd:
        core = self._d.manager.core
        pairs = [
            core.literal(row).equivalent(core.literal(column))
            for row, column in step.transition.pairs
        ]
        return self._d.manager.conjunction(pairs)

    def bsccs(self) -> Iterator[SymbolicSet]:
        """Bottom strongly connected components."""
        d = self._d
        left = d.states
        if self._absorbing:
            yield from self._singletons(self._absorbing)
            left = left - self.steps.backward(self._absorbing, left)
        inside = left
        for _ in range(tuning.BSCC_PIVOTS):
            if not left:
                return
            pivot = self.engine.first(self._set(inside)).bdd
            ahead = self.steps.reachable(pivot)
            back = self.steps.backward(pivot, ahead)
            if ahead == back:
                yield self._set(ahead)
                left = left - self.steps.backward(ahead, left)
                inside = left
            else:
                left = left - self.steps.backward(pivot, left)
                inside = ahead - back
        yield from self.enumerated_bsccs(left)

    def enumerated_bsccs(self, left: Bdd) -> Iterator[SymbolicSet]:
        """The bottom components of a closed set, on its rows."""
        if not left:
            return
        part = self._part(left)
        for states in graph.bsccs(part.weights):
            yield self._numbered(part.states.odd, states)

    def _part(self, states: Bdd) -> System:
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
        part, mecs = self._end_components(within.bdd)
        if part is None:
            return
        order = np.argsort(mecs.of, kind="stable").astype(np.int32)
        start = np.searchsorted(mecs.of[order], np.arange(mecs.count + 1))
        for c in range(mecs.count):
            yield self._numbered(part.states.odd, order[start[c] : start[c + 1]])

    def _lasting(self, within: Bdd) -> Bdd:
        """The states from which some strategy stays in a set for ever."""
        stay = within
        while True:
            smaller = stay & self._d.union(self.steps.classes_within(stay))
            if smaller == stay:
                return stay
            stay = smaller

    def _surely_accepted(self, stay: Bdd, visits: Sequence[SymbolicSet]) -> Bdd:
        """The states from which some strategy surely stays and almost surely visits each set
        infinitely often.

        From each state of the fixpoint, choices that stay in it lead to a member of each set that
        has such a choice: taking these paths again and again succeeds with probability 1.

        Source: Chatterjee & Henzinger (2011), for almost-sure Buchi objectives.
        """
        while stay:
            within = self.steps.classes_within(stay)
            closed = not self.steps.before(self._d.states - stay) & stay
            inside = stay & self._d.union(within)
            for visit in visits:
                target = visit.bdd & inside
                # No choice leaves a closed set, so that any path will do.
                inside = inside & (
                    self.steps.backward(target, stay) if closed else self._nearing(target, within)
                )
            if inside == stay:
                break
            stay = inside
        return stay

    def _nearing(self, target: Bdd, within: Sequence[Bdd]) -> Bdd:
        """The states with a path into a target by the choices of the states per choice class."""
        reached = fresh = target
        while fresh:
            before = self.steps.classes_before(fresh)
            fresh = self._d.union([w & b for w, b in zip(within, before, strict=True)]) - reached
            reached = reached | fresh
        return reached

    def _end_components(
        self, within: Bdd
    ) -> tuple[System, graph.EndComponents] | tuple[None, graph.EndComponents]:
        """End components by enumeration of the states that can stay in `within` for ever."""
        stay = self._lasting(within)
        if not stay:
            return None, graph.EndComponents(np.empty(0, np.int32), np.empty(0, bool), 0)
        part = self._part(stay)
        inside = part.one_step_probability(~part.states) == 0
        return part, graph.maximal_end_components(part.matrix, np.ones(part.n, bool), inside)

    def accepting_end_components(
        self, pairs: Sequence[tuple[SymbolicSet, Sequence[SymbolicSet]]]
    ) -> SymbolicSet:
        """States in an end component that, for some pair (avoid, visits), avoids `avoid` and meets
        every set in `visits`; if there are many, also those from which such a component is reached
        almost surely while `avoid` is avoided.
        """
        accepted = []
        for avoid, visits in pairs:
            stay = self._lasting(self._d.states - avoid.bdd)
            if self._set(stay).count > tuning.END_COMPONENT_STATES:
                accepted.append(self._surely_accepted(stay, visits))
                continue
            part, mecs = self._end_components(stay)
            if part is None:
                continue
            odd = part.states.odd
            good = np.ones(mecs.count, bool)
            for visit in visits:
                met = mecs.of[odd.to_mask(visit.bdd)]
                good &= np.bincount(met[met >= 0], minlength=mecs.count) > 0
            member: Bools = (mecs.of >= 0) & np.append(good, False)[mecs.of]
            accepted.append(odd.from_mask(member))
        return self._set(self._d.union(accepted))
