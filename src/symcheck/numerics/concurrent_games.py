"""Concurrent games: in each state both sides pick an action at once, and a row follows.

The rows of a state are the entries of a matrix game. One step of value iteration solves it for each
state. Strategies are mixed: a probability for each action of a side in each state. If one side
fixes its strategy, a decision process of the other one remains, whose rows are mixtures.

Sources: Shapley (1953), Stochastic games; de Alfaro, Henzinger & Kupferman (2007), Concurrent
reachability games.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics.matrix_games import optimal_strategies

__all__ = ["Game", "Proposal", "Side"]


class Proposal(NamedTuple):
    """What value iteration proposes.

    Attributes:
        values: float64[states].
        mine, theirs: the probability of each action of who maximises, and of who minimises.
    """

    values: Floats
    mine: Floats
    theirs: Floats


@dataclass(frozen=True, eq=False)
class Side:
    """The actions of a side, numbered through all states in their order.

    Attributes:
        of_row: the action by which each row is taken, int64[rows].
        starts: the first action of each state, and their number, int64[states+1].
    """

    of_row: Int64s = field(repr=False)
    starts: Int64s = field(repr=False)

    @staticmethod
    def of(labels: Int64s, state_of_row: Int64s, states: int) -> Side:
        """A side that takes rows of a state with the same label by the same action."""
        most = int(labels.max(initial=0)) + 1
        actions, of_row = np.unique(state_of_row * most + labels, return_inverse=True)
        return Side(of_row, starts_of(np.bincount(actions // most, minlength=states)))

    @property
    def count(self) -> int:
        """The number of actions in all states."""
        return int(self.starts[-1])

    @property
    def chooses(self) -> bool:
        """Whether there are several actions in some state."""
        return self.count >= len(self.starts)

    def minimum(self, of_actions: Floats) -> Floats:
        """The least number of each state."""
        minimum: Floats = np.minimum.reduceat(of_actions, self.starts[:-1])
        return minimum

    def sums(self, of_rows: Floats) -> Floats:
        """Numbers of rows, added for each action."""
        return np.bincount(self.of_row, of_rows, self.count).astype(np.float64, copy=False)

    def uniform(self, among: Bools | None = None) -> Floats:
        """Each action of a state with the same probability.

        among: the actions that are taken, bool[actions]; in states without one, all are.
        """
        counts = np.diff(self.starts)
        taken = np.ones(self.count) if among is None else among.astype(np.float64)
        taken[np.repeat(np.add.reduceat(taken, self.starts[:-1]) == 0.0, counts)] = 1.0
        shares: Floats = taken / np.repeat(np.add.reduceat(taken, self.starts[:-1]), counts)
        return shares


@dataclass(frozen=True, eq=False)
class Game:
    """A game in which each pair of actions of a state is one row.

    Attributes:
        matrix: the rows, in doubles, grouped by states.
        maximiser, minimiser: the actions of both sides.
    """

    matrix: SparseMatrix = field(repr=False)
    maximiser: Side
    minimiser: Side

    @property
    def swapped(self) -> Game:
        """The game in which the sides have exchanged their parts."""
        return Game(self.matrix, self.minimiser, self.maximiser)

    @property
    def nothing(self) -> Floats:
        """The rewards of rows that earn nothing."""
        return np.zeros(self.matrix.rows)

    @cached_property
    def state_of_row(self) -> Int64s:
        """The state of each row."""
        return self.matrix.state_of_row

    @cached_property
    def shapes(self) -> list[tuple[Int64s, Int64s, Int64s]]:
        """The games with the same numbers of actions: the row of each pair, int64[games, k, m], and
        the actions of both sides, int64[games, k] and int64[games, m].
        """
        assert self.matrix.groups is not None
        mine, theirs = np.diff(self.maximiser.starts), np.diff(self.minimiser.starts)
        first, other = self.maximiser.starts[:-1], self.minimiser.starts[:-1]
        place = self.maximiser.of_row - first[self.state_of_row]
        place = place * theirs[self.state_of_row] + self.minimiser.of_row - other[self.state_of_row]
        rows = np.empty(self.matrix.rows, np.int64)
        rows[self.matrix.groups[:-1][self.state_of_row] + place] = np.arange(self.matrix.rows)
        found = []
        for k, m in np.unique(np.stack((mine, theirs)), axis=1).T.tolist():
            states = np.flatnonzero((mine == k) & (theirs == m))
            begin = self.matrix.groups[states]
            pairs = rows[spans(begin, begin + k * m)].reshape(-1, k, m)
            found.append(
                (pairs, first[states, None] + np.arange(k), other[states, None] + np.arange(m))
            )
        return found

    def strategies(self, payoffs: Floats) -> tuple[Floats, Floats]:
        """Optimal strategies of both sides for one step.

        Args:
            payoffs: what each row is worth, float64[rows].

        Returns:
            The probability of each action of the maximiser and of the minimiser.
        """
        mine, theirs = np.empty(self.maximiser.count), np.empty(self.minimiser.count)
        for pairs, rows, columns in self.shapes:
            mine[rows], theirs[columns] = optimal_strategies(payoffs[pairs])
        return mine, theirs

    def ensured(self, mine: Floats, payoffs: Floats) -> Floats:
        """What a strategy of the maximiser guarantees in one step, per state."""
        return self.minimiser.minimum(self.minimiser.sums(mine[self.maximiser.of_row] * payoffs))

    def conceded(self, theirs: Floats, payoffs: Floats) -> Floats:
        """What a strategy of the minimiser concedes in one step at most, per state."""
        return -self.maximiser.minimum(
            self.maximiser.sums(theirs[self.minimiser.of_row] * -payoffs)
        )

    @property
    def terms(self) -> int:
        """The most actions of a side in a state."""
        return int(max(np.diff(s.starts).max(initial=1) for s in (self.maximiser, self.minimiser)))

    def process(self, fixed: Side, strategy: Floats, earned: Floats) -> tuple[SparseMatrix, Floats]:
        """The decision process of the other side if one side fixes its strategy.

        Args:
            fixed: the maximiser or the minimiser.
            strategy: the probability of each of its actions.
            earned: the reward of each row.

        Returns:
            The rows of the actions of the other side, and what they earn in expectation.
        """
        from scipy.sparse import csr_array

        other = self.minimiser if fixed is self.maximiser else self.maximiser
        weights = strategy[fixed.of_row]
        rows = np.arange(self.matrix.rows)
        mixing = csr_array((weights, (other.of_row, rows)), shape=(other.count, self.matrix.rows))
        indptr, indices, data = self.matrix.arrays
        entries = csr_array((data, indices, indptr), shape=(self.matrix.rows, self.matrix.columns))
        mixed = mixing @ entries
        mixed.sum_duplicates()
        mixed.eliminate_zeros()
        matrix = SparseMatrix(
            mixed.indptr.astype(np.int64),
            mixed.indices.astype(np.int32),
            mixed.data,
            self.matrix.columns,
            other.starts,
        )
        return matrix, other.sums(weights * earned)

    def iterate(
        self, fixed: Bools, values: Floats, earned: Floats, barred: Bools | None = None
    ) -> Iterator[Proposal]:
        """Value iteration from below, which proves nothing.

        An action is changed only where that is better by more than rounding, so that the strategy
        of the maximiser does not put off for ever what it wants (as in decision processes).

        Args:
            fixed: the states that keep their values, bool[states].
            values: to begin with, float64[states].
            earned: what each row earns, float64[rows].
            barred: the rows whose actions the minimiser does not take, bool[rows]; None: none.

        """
        chosen = self.maximiser.uniform()
        while True:
            payoffs = earned + self.matrix.multiply(values)
            if barred is not None:
                assert self.matrix.groups is not None
                worst = np.maximum.reduceat(payoffs, self.matrix.groups[:-1])
                payoffs = np.where(barred, worst[self.state_of_row] + 1.0, payoffs)
            mine, theirs = self.strategies(payoffs)
            found = np.where(fixed, values, self.ensured(mine, payoffs))
            better = found > values + 1e-14 * np.abs(values)
            chosen = np.where(np.repeat(better, np.diff(self.maximiser.starts)), mine, chosen)
            values = np.maximum(found, values)
            yield Proposal(values, chosen, theirs)

    def almost_surely(self, target: Bools) -> tuple[Bools, Bools]:
        """Where the minimiser can reach a target almost surely, whatever the maximiser does.

        Returns:
            The states, bool[states], and the rows whose action of the minimiser is safe: all its
            successors are such states, bool[rows].
        """
        within = np.ones(len(target), np.bool_)
        while True:
            safe = (self.minimiser.sums(self._lead_into(~within)) == 0.0)[self.minimiser.of_row]
            found = target
            while True:
                answers = self.maximiser.sums(safe * self._lead_into(found))
                grown = found | (within & (self.maximiser.minimum(answers) > 0.0))
                if (grown == found).all():
                    break
                found = grown
            if (found == within).all():
                return found, safe
            within = found

    def _lead_into(self, states: Bools) -> Floats:
        """1 of the rows by which some of these states can follow, 0 of others."""
        hits = states[self.matrix.indices]
        found: Floats = np.logical_or.reduceat(hits, self.matrix.indptr[:-1]).astype(np.float64)
        return found
