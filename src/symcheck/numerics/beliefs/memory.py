"""Finite memory that follows observations, and the product of a model with it.

Sources: Baier, Bertrand & Größer (2008), 'On decision problems for probabilistic Büchi automata';
Chatterjee, Doyen & Henzinger (2010), 'Qualitative analysis of partially-observable Markov decision
processes'.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, spans
from symcheck.numerics import graph
from symcheck.numerics.beliefs.exploration import Beliefs, Rows
from symcheck.numerics.beliefs.observed import GOAL, SINK, Observed, gathered

__all__ = ["Memory"]


@dataclass(frozen=True, eq=False)
class Memory:
    """Memory values, of which each knows the states in which it may be: all its rows are known.

    Attributes:
        model: the model whose observations change the memory.
        beliefs: per memory value the states that are possible.
        rows: the transitions; one target for each observation.
    """

    model: Observed = field(repr=False)
    beliefs: Beliefs = field(repr=False)
    rows: Rows = field(repr=False)

    @property
    def pairs(self) -> int:
        """The number of pairs of a memory value and a possible state."""
        return len(self.beliefs.states)

    @cached_property
    def _choices(self) -> Int64s:
        """The number of rows of each pair."""
        return np.bincount(self.rows.row_of_belief, minlength=len(self.beliefs))[self.beliefs.owner]

    @cached_property
    def row_of_memory(self) -> Int64s:
        """The row of the memory of each row of `matrix`."""
        first = self.rows.first[self.beliefs.owner]
        return spans(first, first + self._choices)

    @cached_property
    def row_of_model(self) -> Int64s:
        """The row of the model of each row of `matrix`."""
        first = self.model.groups[self.beliefs.states]
        return spans(first, first + self._choices)

    def pair(self, memory: Int64s, states: Int64s) -> Int64s:
        """The numbers of pairs."""
        size, rank = self.model.states, self.model.rank
        stored = self.beliefs.owner * size + rank[self.beliefs.states]
        return np.searchsorted(stored, memory * size + rank[states])

    @cached_property
    def matrix(self) -> SparseMatrix:
        """The product: after the pairs come two states, GOAL and SINK, without rows."""
        model, rows, n = self.model, self.rows, self.pairs
        whole = model.matrix
        inner = self.row_of_model
        lengths = whole.lengths[inner]
        entries = spans(whole.indptr[:-1][inner], whole.indptr[1:][inner])
        states = whole.indices[entries].astype(np.int64)
        classes = model.classes[states]
        width = len(model.choices) + 2
        sought = np.repeat(self.row_of_memory, lengths) * width + classes
        after = rows.target[np.searchsorted(rows.row * width + rows.observed, sought)]
        pair = self.pair(after, states)
        pair[after == GOAL], pair[after == SINK] = n, n + 1
        row = np.repeat(np.arange(len(inner)), lengths)
        owner = np.repeat(np.arange(n), self._choices)
        return gathered(row, pair, whole.data[entries], owner, n + 2)

    def chain(self, shares: Floats) -> SparseMatrix:
        """The chain of a strategy, given the share of each row; GOAL and SINK are absorbing."""
        matrix, every = self.matrix, np.arange(self.pairs + 2)
        share = shares[self.row_of_memory]
        taken = np.flatnonzero(share > 0)
        chosen = matrix.choose(taken)
        mixed = gathered(
            np.append(np.repeat(matrix.state_of_row[taken], chosen.lengths), every[-2:]),
            np.append(chosen.indices, every[-2:]),
            np.append(chosen.data * np.repeat(share[taken], chosen.lengths), (1.0, 1.0)),
            every,
            len(every),
        )
        return replace(mixed, groups=None)

    def surely_safe(self) -> tuple[Bools, Bools]:
        """The memory values from which some strategy surely never meets GOAL, and its rows."""
        safe = np.ones(len(self.beliefs), np.bool_)
        safe[GOAL] = False
        return self._greatest(safe)

    def almost_surely(self) -> tuple[Bools, Bools]:
        """The memory values from which a strategy meets GOAL almost surely, and the rows that such
        a strategy may take.

        Taking each of these rows with positive probability is such a strategy.
        """
        matrix, n = self.matrix, self.pairs
        alive = np.ones(len(self.beliefs), np.bool_)
        alive[SINK] = False
        goal = np.zeros(n + 2, np.bool_)
        goal[n] = True
        while True:
            alive, usable = self._greatest(alive)
            rows = np.flatnonzero(usable[self.row_of_memory])
            left = np.searchsorted(matrix.state_of_row[rows], np.arange(n + 3))
            near = graph.backward_reachable(matrix.choose(rows, left), goal)
            lost = self.beliefs.owner[~near[:n]]
            if not alive[lost].any():
                return alive, usable
            alive[lost] = False

    def _greatest(self, alive: Bools) -> tuple[Bools, Bools]:
        """The largest part in which each memory value has a row that stays, and these rows."""
        rows = self.rows
        starts = np.flatnonzero(np.diff(rows.row, prepend=-1))
        expanded = np.flatnonzero(rows.first >= 0)
        while True:
            stays = (
                np.logical_and.reduceat(alive[rows.target], starts) if len(starts) else starts > 0
            )
            usable = stays & alive[rows.row_of_belief]
            some = np.bincount(rows.row_of_belief[stays], minlength=len(alive)) > 0
            lost = expanded[alive[expanded] & ~some[expanded]]
            if not len(lost):
                return alive, usable
            alive = alive.copy()
            alive[lost] = False
