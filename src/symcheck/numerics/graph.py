"""Graph questions on sparse matrices: components, reachability, and where probabilities are 0 or 1.

Sets of states are bool[n]. A stored entry counts as an edge, whatever its value (do not store zeros). In an MDP (a matrix
with groups), 'min' and 'max' range over strategies. Sources: Baier & Katoen (2008), chapters 10.1 and 10.6; de Alfaro (1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.graph import components as kernel
from symcheck.kernels.graph import mdp_graph
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix

__all__ = [
    "Components",
    "EndComponents",
    "Incidence",
    "accepting_end_components",
    "backward_reachable",
    "bsccs",
    "forward_reachable",
    "maximal_end_components",
    "prob0",
    "prob0a",
    "prob0e",
    "prob1",
    "prob1a",
    "prob1e",
    "prob1e_strategy",
    "sccs",
    "shortest_path",
]


_SLICE = 65536  # components


@dataclass(frozen=True, eq=False)
class Incidence:
    """A square matrix seen from its columns, made once and shared by several questions (made lazily)."""

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
        """State of each row, also where rows are states."""
        return (
            self.owner
            if self.matrix.groups is not None
            else np.arange(self.matrix.rows, dtype=np.int32)
        )


@dataclass(frozen=True, eq=False)
class Components:
    """Strong components, numbered so that edges lead to equal or lower numbers.

    `of` (int32[n]): a state's component, -1 outside of the states asked about. Component c consists of the states
    `order[start[c]:start[c+1]]`, listed successors first as far as possible.
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
        """States of each component."""
        return np.diff(self.start)

    @property
    def largest(self) -> int:
        """States of the largest component; found without an array of all sizes, which may be as many as states."""
        return max(
            (
                int(np.diff(self.start[i : i + _SLICE + 1]).max())
                for i in range(0, self.count, _SLICE)
            ),
            default=0,
        )

    def members(self, component: int) -> Int32s:
        """States of a component."""
        return self.order[self.start[component] : self.start[component + 1]]


@dataclass(frozen=True, eq=False)
class EndComponents:
    """Maximal end components: `of` (int32[n], -1 for none) and the rows that stay inside (`rows`, bool[rows])."""

    of: Int32s
    rows: Bools
    count: int


Source = SparseMatrix | Incidence


def _incidence(source: Source) -> Incidence:
    return source if isinstance(source, Incidence) else Incidence(source)


def _mask(states: Bools) -> np.ndarray[tuple[int], np.dtype[np.uint8]]:
    return np.ascontiguousarray(states, dtype=np.bool_).view(np.uint8)


def sccs(source: Source, within: Bools | None = None) -> Components:
    """Strongly connected components, successors first (Tarjan 1972). Edges to states outside of `within` are ignored."""
    graph = _incidence(source)
    return Components(
        *kernel.components(
            graph.edges, graph.matrix.indices, None if within is None else _mask(within)
        )
    )


def bsccs(source: Source, within: Bools | None = None) -> list[Int32s]:
    """Components that nothing leaves, as arrays of states in ascending order. An edge out of `within` counts as leaving."""
    graph = _incidence(source)
    parts = sccs(graph, within)
    closed = kernel.bottom_components(graph.edges, graph.matrix.indices, parts.of, parts.count)
    return [np.sort(parts.members(c)) for c in np.flatnonzero(closed).tolist()]


def forward_reachable(source: Source, sources: Bools, through: Bools | None = None) -> Bools:
    """States reachable from `sources`, passing only through states of `through` (default: all)."""
    graph = _incidence(source)
    through = np.ones(graph.matrix.states, dtype=np.bool_) if through is None else through
    return kernel.forward_reachable(
        graph.edges, graph.matrix.indices, _mask(sources), _mask(through)
    ).view(np.bool_)


def backward_reachable(source: Source, target: Bools, through: Bools | None = None) -> Bools:
    """States from which some path (of some strategy) leads into `target`, through states of `through`; with `target` itself."""
    graph = _incidence(source)
    through = np.ones(graph.matrix.states, dtype=np.bool_) if through is None else through
    return kernel.backward_reachable(
        graph.pre, graph.rows_in, graph.owner, _mask(target), _mask(through)
    ).view(np.bool_)


def prob0(source: Source, left: Bools, right: Bools, direction: Direction | None = None) -> Bools:
    """States whose probability of `left U right` is 0: the only one (None), the least ('min') or the greatest ('max')."""
    return (
        prob0e(source, left, right) if direction == Direction.MIN else prob0a(source, left, right)
    )


def prob1(source: Source, left: Bools, right: Bools, direction: Direction | None = None) -> Bools:
    """States whose probability of `left U right` is 1: the only one (None), the least ('min') or the greatest ('max')."""
    return (
        prob1e(source, left, right) if direction == Direction.MAX else prob1a(source, left, right)
    )


def prob0a(source: Source, left: Bools, right: Bools) -> Bools:
    """States from which no strategy reaches: the greatest probability of `left U right` is 0. Linear time."""
    return ~backward_reachable(source, right, left)


def prob0e(source: Source, left: Bools, right: Bools) -> Bools:
    """States with a strategy that never reaches: the least probability of `left U right` is 0. Linear time."""
    graph = _incidence(source)
    if graph.matrix.groups is None:
        return prob0a(graph, left, right)
    sure = mdp_graph.attractor(
        graph.pre, graph.rows_in, graph.owner, graph.groups, _mask(right), _mask(left)
    )
    return ~sure.view(np.bool_)


def prob1a(source: Source, left: Bools, right: Bools) -> Bools:
    """States from which every strategy reaches almost surely: the least probability of `left U right` is 1. Linear time."""
    graph = _incidence(source)
    return ~backward_reachable(graph, prob0e(graph, left, right), left & ~right)


def prob1e(source: Source, left: Bools, right: Bools) -> Bools:
    """States with a strategy that reaches almost surely: the greatest probability of `left U right` is 1."""
    if _incidence(source).matrix.groups is None:
        return prob1a(source, left, right)
    return prob1e_strategy(source, left, right)[0]


def prob1e_strategy(source: Source, left: Bools, right: Bools) -> tuple[Bools, Int64s]:
    """`prob1e`, and a row per state that stays within the set and moves nearer to `right` (-1 at `right` and outside)."""
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


def maximal_end_components(
    source: Source, within: Bools, rows: Bools | None = None
) -> EndComponents:
    """Maximal end components made of states of `within` and of `rows` (default: all).

    A row that may leave `within` is never part of one; mass missing from a row is not seen here: exclude such rows.
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
    source: Source, pairs: Sequence[tuple[Bools, Sequence[Bools]]]
) -> Bools:
    """States in an end component that, for some pair (avoid, visits), avoids `avoid` and meets every set in `visits`."""
    graph = _incidence(source)
    found = np.zeros(graph.matrix.states, dtype=np.bool_)
    for avoid, visits in pairs:
        parts = maximal_end_components(graph, ~avoid)
        good = np.ones(parts.count, dtype=np.bool_)
        for visit in visits:
            met = np.zeros(parts.count, dtype=np.bool_)
            met[parts.of[visit & (parts.of >= 0)]] = True
            good &= met
        inside = parts.of >= 0
        found[inside] |= good[parts.of[inside]]
    return found


def shortest_path(
    source: Source, sources: Bools, target: Bools, through: Bools | None = None
) -> Int64s | None:
    """States of a shortest path from `sources` into `target` through states of `through`; None if there is none."""
    graph = _incidence(source)
    through = np.ones(graph.matrix.states, dtype=np.bool_) if through is None else through
    path = kernel.shortest_path(
        graph.edges, graph.matrix.indices, _mask(sources), _mask(through), _mask(target)
    )
    return path if len(path) else None
