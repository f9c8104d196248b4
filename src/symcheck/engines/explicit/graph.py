"""Graph questions of the explicit engine: `symcheck.numerics.graph` in terms of sets of states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import ExplicitOwner
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, spans
from symcheck.numerics import graph
from symcheck.numerics.game_graph import Arena

__all__ = ["ExplicitGraph"]


@dataclass(frozen=True)
class ExplicitGraph:
    """See `symcheck.engines.base.Graph`."""

    engine: ExplicitOwner = field(repr=False)

    @cached_property
    def _edges(self) -> graph.Incidence:
        return graph.Incidence(self.engine.weights)

    def forget(self) -> None:
        """Free the memory of the transposed matrix, which is rebuilt on the next use."""
        vars(self).pop("_edges", None)

    def predecessors(self, states: ArraySet) -> ArraySet:
        """States with some transition (of some choice) into the set."""
        members = np.zeros(self.engine.states, bool)
        pre = self._edges.pre
        rows = self._edges.rows_in[spans(pre[:-1][states.members], pre[1:][states.members])]
        members[self._edges.owner_of_rows[rows]] = True
        return ArraySet(members)

    def all_successors_in(self, states: ArraySet) -> ArraySet:
        """States all of whose transitions (of all choices) lead into the set."""
        return ~self.predecessors(~states)

    def exists_until(self, left: ArraySet, right: ArraySet) -> ArraySet:
        """E [ left U right ]."""
        return ArraySet(graph.backward_reachable(self._edges, right.members, left.members))

    def exists_globally(self, states: ArraySet) -> ArraySet:
        """E [ G states ]: some path in the set reaches a cycle in it.

        A strong component with an edge inside has a cycle; every state has a successor, so nothing
        else stays for ever.
        """
        cyclic = self._on_cycles(states.members)
        return ArraySet(graph.backward_reachable(self._edges, cyclic, states.members))

    def _on_cycles(self, within: Bools) -> Bools:
        parts = graph.sccs(self._edges, within)
        single = np.zeros(self.engine.states, bool)
        inside = parts.of >= 0
        single[inside] = parts.sizes[parts.of[inside]] == 1
        return inside & (~single | self._self_loops)

    @cached_property
    def _self_loops(self) -> Bools:
        m = self.engine.weights
        owners = np.repeat(self._edges.owner_of_rows, m.lengths)
        loops = np.zeros(m.states, bool)
        loops[owners[owners == m.indices]] = True
        return loops

    def prob0(self, left: ArraySet, right: ArraySet, direction: Direction | None) -> ArraySet:
        """States whose (min/max) probability of left U right is 0."""
        if self.engine.opponents is not None:
            arena = self._arena(self.engine.opponents, direction)
            rows = arena.into(right.members)
            found, _ = arena.attract(rows, left.members & ~right.members)
            return ~ArraySet(found | right.members)
        return ArraySet(graph.prob0(self._edges, left.members, right.members, direction))

    def prob1(self, left: ArraySet, right: ArraySet, direction: Direction | None) -> ArraySet:
        """States whose (min/max) probability of left U right is 1."""
        if self.engine.opponents is not None:
            arena = self._arena(self.engine.opponents, direction)
            left, rows = left - right, arena.into(right.members)
            found, _ = arena.almost_surely(
                rows, arena.into((~(left | right)).members), left.members
            )
            return ArraySet(found) | right
        return ArraySet(graph.prob1(self._edges, left.members, right.members, direction))

    def _arena(self, opponents: Bools, direction: Direction | None) -> Arena:
        """The game of those who maximise against those who minimise."""
        return Arena(self._edges, opponents ^ (direction is Direction.MIN))

    def bsccs(self) -> Iterator[ArraySet]:
        """Bottom strongly connected components."""
        for states in graph.bsccs(self._edges):
            yield ArraySet.of(self.engine.states, states)

    def end_components(self, within: ArraySet) -> Iterator[ArraySet]:
        """Maximal end components of the states `within`."""
        parts = graph.maximal_end_components(self._edges, within.members)
        order = np.argsort(parts.of, kind="stable").astype(np.int32)
        start = np.searchsorted(parts.of[order], np.arange(parts.count + 1))
        for c in range(parts.count):
            yield ArraySet.of(self.engine.states, order[start[c] : start[c + 1]])

    def accepting_end_components(
        self, pairs: Sequence[tuple[ArraySet, Sequence[ArraySet]]]
    ) -> ArraySet:
        """States in an end component that, for some pair (avoid, visits), avoids `avoid` and meets
        every set in `visits`.
        """
        arrays = [(avoid.members, [v.members for v in visits]) for avoid, visits in pairs]
        return ArraySet(graph.accepting_end_components(self._edges, arrays))

    def witness(self, left: ArraySet, right: ArraySet) -> Sequence[Mapping[str, int | bool]] | None:
        """A shortest path from an initial state that satisfies left U right, as states; None if
        there is none.
        """
        path = graph.shortest_path(
            self._edges, self.engine.initial.members, right.members, left.members
        )
        if path is None:
            return None
        names = [v.name for v in self.engine.model.variables]
        states = [
            next(iter(self.engine.valuations(ArraySet.of(self.engine.states, s)))) for s in path
        ]
        return [dict(zip(names, state, strict=True)) for state in states]
