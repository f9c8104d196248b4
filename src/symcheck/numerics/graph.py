"""Graph algorithms on sparse matrices: components, reachability, Prob0 and Prob1 precomputation.

Sets of states are bool[n]. A stored entry is an edge, whatever its value (zeros must not be
stored). In an MDP (a matrix with groups), 'min' and 'max' range over strategies.

Sources: Baier & Katoen (2008), 10.1 and 10.6; de Alfaro (1997) for end components.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.arrays import Masks
from symcheck.kernels.graph import components as kernel
from symcheck.kernels.graph import mdp_graph
from symcheck.kernels.rows import sparse
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.numerics import tuning

__all__ = [
    "Components",
    "EndComponents",
    "Incidence",
    "accepting_end_components",
    "backward_reachable",
    "bsccs",
    "exit_policy",
    "forward_reachable",
    "grouped",
    "maximal_end_components",
    "nontrivial_sccs",
    "prob0",
    "prob1",
    "prob1e_strategy",
    "sccs",
    "shortest_path",
]


@dataclass(frozen=True, eq=False)
class Incidence:
    """A square matrix with its transposed graph, computed on demand and shared by queries."""

    matrix: SparseMatrix

    @cached_property
    def groups(self) -> Int64s:
        """Rows of each state: int64[n+1]."""
        return (
            np.arange(self.matrix.rows + 1, dtype=np.int64)
            if self.matrix.groups is None
            else self.matrix.groups
        )

    @cached_property
    def owner(self) -> Int32s:
        """State of each row: int32[rows]; empty where rows are states."""
        if self.matrix.groups is None:
            return np.empty(0, dtype=np.int32)
        return np.repeat(np.arange(self.matrix.states, dtype=np.int32), np.diff(self.matrix.groups))

    @cached_property
    def edges(self) -> Int64s:
        """Entries of each state: int64[n+1]."""
        return (
            self.matrix.indptr
            if self.matrix.groups is None
            else self.matrix.indptr[self.matrix.groups]
        )

    def mask(self, states: Bools | None) -> Masks:
        """A set of states as bytes; None: all."""
        return _mask(np.ones(self.matrix.states, np.bool_) if states is None else states)

    @cached_property
    def _transposed(self) -> tuple[Int64s, Int32s]:
        return sparse.transpose(self.matrix.indptr, self.matrix.indices, self.matrix.columns)

    @property
    def pre(self) -> Int64s:
        """Where each column's rows begin in `rows_in`: int64[n+1]."""
        return self._transposed[0]

    @property
    def rows_in(self) -> Int32s:
        """Rows with an entry in a column, by column."""
        return self._transposed[1]

    @cached_property
    def owner_of_rows(self) -> Int32s:
        """The state of each row, also if rows are states."""
        return (
            self.owner
            if self.matrix.groups is not None
            else np.arange(self.matrix.rows, dtype=np.int32)
        )


@dataclass(frozen=True, eq=False)
class Components:
    """Strong components, numbered so that edges lead to equal or lower numbers.

    of: the component of each state, int32[n]; -1 for states that were not considered.
    order, start: component c consists of the states `order[start[c]:start[c+1]]`, successors first
      as far as possible.
    """

    of: Int32s
    order: Int32s
    start: Int64s

    @property
    def count(self) -> int:
        """Number of components."""
        return len(self.start) - 1

    @property
    def sizes(self) -> Int64s:
        """The number of states of each component."""
        return np.diff(self.start)

    @property
    def largest(self) -> int:
        """The number of states of the largest component, computed without an array of all sizes."""
        return max(
            (
                int(np.diff(self.start[i : i + tuning.STATES_PER_SLICE + 1]).max())
                for i in range(0, self.count, tuning.STATES_PER_SLICE)
            ),
            default=0,
        )

    def members(self, component: int) -> Int32s:
        """States of a component."""
        return self.order[self.start[component] : self.start[component + 1]]


@dataclass(frozen=True, eq=False)
class EndComponents:
    """Maximal end components.

    of: the component of each state, int32[n], -1 for none. rows: bool[rows], the rows that stay
    inside a component. count: the number of components.
    """

    of: Int32s
    rows: Bools
    count: int

    def representatives(self) -> Int64s:
        """The first state of the component of each state; the state itself if there is none."""
        states, inside = np.arange(len(self.of)), self.of >= 0
        first = np.full(self.count, len(states))
        np.minimum.at(first, self.of[inside], states[inside])
        states[inside] = first[self.of[inside]]
        return states

    def quotient_states(self) -> tuple[Int32s, int]:
        """The state of each state in the quotient by the components, and their number.

        They are in the order of their first members.
        """
        first = self.representatives()
        leads = first == np.arange(len(first))
        return (np.cumsum(leads) - 1)[first].astype(np.int32), int(leads.sum())

    def meeting(self, sets: Sequence[Bools]) -> Bools:
        """The states of the components that meet all of some sets."""
        inside = self.of >= 0
        good = np.ones(self.count, dtype=np.bool_)
        for states in sets:
            good &= np.bincount(self.of[states & inside], minlength=self.count) > 0
        accepted = np.zeros(len(self.of), dtype=np.bool_)
        accepted[inside] = good[self.of[inside]]
        return accepted


Source = SparseMatrix | Incidence


def _incidence(source: Source) -> Incidence:
    return source if isinstance(source, Incidence) else Incidence(source)


def _mask(states: Bools) -> Masks:
    return np.ascontiguousarray(states, dtype=np.bool_).view(np.uint8)


def sccs(source: Source, within: Bools | None = None) -> Components:
    """Strong components, successors first (Tarjan 1972); edges that leave `within` are ignored."""
    graph = _incidence(source)
    return Components(
        *kernel.components(
            graph.edges, graph.matrix.indices, None if within is None else _mask(within)
        )
    )


def grouped(of: Int32s) -> list[Int64s]:
    """The states of each component, ascending; `of` is the component of each state, -1 for none."""
    order = np.argsort(of, kind="stable")
    order = order[of[order] >= 0]
    return np.split(order, np.flatnonzero(np.diff(of[order])) + 1) if len(order) else []


def nontrivial_sccs(source: Source) -> list[Int64s]:
    """Strong components with an edge inside, as ascending arrays of states."""
    graph = _incidence(source)
    matrix, looping = graph.matrix, np.zeros(graph.matrix.states, np.bool_)
    owners = np.repeat(graph.owner_of_rows, matrix.lengths)
    looping[owners[owners == matrix.indices]] = True
    return [g for g in grouped(sccs(graph).of) if len(g) > 1 or looping[g[0]]]


def bsccs(source: Source, within: Bools | None = None) -> list[Int32s]:
    """Bottom strong components, as ascending arrays of states; edges out of `within` leave them."""
    graph = _incidence(source)
    parts = sccs(graph, within)
    closed = kernel.bottom_components(graph.edges, graph.matrix.indices, parts.of, parts.count)
    return [np.sort(parts.members(c)) for c in np.flatnonzero(closed).tolist()]


def forward_reachable(source: Source, sources: Bools, through: Bools | None = None) -> Bools:
    """States reachable from `sources`, passing only through states of `through` (default: all)."""
    graph = _incidence(source)
    _, parent = kernel.breadth_first(
        graph.edges, graph.matrix.indices, _mask(sources), graph.mask(through)
    )
    return np.asarray(parent > -2)


def backward_reachable(source: Source, target: Bools, through: Bools | None = None) -> Bools:
    """The target, and the states with a path (of some strategy) into it through `through`."""
    graph = _incidence(source)
    return kernel.backward_reachable(
        graph.pre, graph.rows_in, graph.owner, _mask(target), graph.mask(through)
    ).view(np.bool_)


def prob0(source: Source, left: Bools, right: Bools, direction: Direction | None = None) -> Bools:
    """States whose (None), minimal or maximal probability of `left U right` is 0."""
    graph = _incidence(source)
    if direction != Direction.MIN or graph.matrix.groups is None:
        return ~backward_reachable(graph, right, left)
    from symcheck.kernels.graph import partial_search

    sure, misses = right.copy(), np.diff(graph.groups).astype(np.int32)
    hit, found = np.zeros(graph.matrix.rows, np.uint8), np.flatnonzero(right).astype(np.int32)
    partial_search.search(
        graph.pre, graph.rows_in, graph.owner, hit, misses, _mask(left), found, _mask(sure)
    )
    return ~sure


def prob1(source: Source, left: Bools, right: Bools, direction: Direction | None = None) -> Bools:
    """States whose (None), minimal or maximal probability of `left U right` is 1."""
    graph = _incidence(source)
    if direction == Direction.MAX and graph.matrix.groups is not None:
        return prob1e_strategy(graph, left, right)[0]
    zero = prob0(graph, left, right, Direction.MIN)
    return ~backward_reachable(graph, zero, left & ~right)


def prob1e_strategy(source: Source, left: Bools, right: Bools) -> tuple[Bools, Int64s]:
    """Maximal `prob1` with a strategy: a row per state that stays in the set and nears `right`.

    The row is -1 at `right` and outside of the set.
    """
    graph = _incidence(source)
    matrix = graph.matrix
    alive, rows = mdp_graph.almost_sure_reachability(
        matrix.indptr,
        matrix.indices,
        graph.groups,
        graph.pre,
        graph.rows_in,
        graph.owner_of_rows,
        _mask(right),
        _mask(left),
    )
    return alive.view(np.bool_), rows


def exit_policy(source: Source, exits: Bools) -> Int64s | None:
    """A row per state by which rows of `exits` (bool[rows]) are taken almost surely, or None.

    Each state takes such a row if it has one, and otherwise a row that nears such states.
    """
    graph = _incidence(source)
    leaving = np.flatnonzero(exits)
    owner = graph.owner_of_rows[leaving]
    can_exit = np.zeros(graph.matrix.states, dtype=np.bool_)
    can_exit[owner] = True
    sure, rows = prob1e_strategy(graph, np.ones(len(can_exit), dtype=np.bool_), can_exit)
    rows[owner] = leaving
    return rows if sure.all() else None


def maximal_end_components(
    source: Source, within: Bools, rows: Bools | None = None
) -> EndComponents:
    """Maximal end components of states of `within` and of rows of `rows` (default: all).

    Rows that may leave `within` belong to none. Rows whose probabilities sum to less than 1 must be
    excluded by the caller.
    """
    graph = _incidence(source)
    matrix = graph.matrix
    usable = None if rows is None else _mask(rows)
    of, enabled, count = mdp_graph.maximal_end_components(
        matrix.indptr,
        matrix.indices,
        graph.groups,
        graph.pre,
        graph.rows_in,
        graph.owner_of_rows,
        _mask(within),
        usable,
    )
    return EndComponents(of, enabled.view(np.bool_), count)


def accepting_end_components(
    source: Source, pairs: Sequence[tuple[Bools, Sequence[Bools]]], rows: Bools | None = None
) -> Bools:
    """States in an end component that, for some pair, avoids `avoid` and meets all `visits`.

    rows: the rows that may be taken in an end component, bool[rows]; None: all.
    """
    graph = _incidence(source)
    accepting = np.zeros(graph.matrix.states, dtype=np.bool_)
    for avoid, visits in pairs:
        accepting |= maximal_end_components(graph, ~avoid, rows).meeting(visits)
    return accepting


def shortest_path(
    source: Source, sources: Bools, target: Bools, through: Bools | None = None
) -> Int64s | None:
    """The states of a shortest path from `sources` to `target` through `through`, or None."""
    graph = _incidence(source)
    order, parent = kernel.breadth_first(
        graph.edges, graph.matrix.indices, _mask(sources), graph.mask(through)
    )
    path = order[target[order]][:1].tolist()  # the nearest state of the target
    while path and parent[path[-1]] >= 0:
        path.append(int(parent[path[-1]]))
    return np.array(path[::-1], np.int64) if path else None
