"""Graph questions of turn-based games: attractors, almost-sure and repeated reachability.

One side, the chooser, wants something to happen, and the other one wants to prevent it. Questions
are about rows: a goal is a set of rows to be taken.

Sources: Chatterjee & Henzinger (2012), A survey of stochastic ω-regular games; de Alfaro &
Henzinger (2000), Concurrent omega-regular games, for turn-based ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from symcheck.kernels.graph import partial_search
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Int64s, spans
from symcheck.numerics.graph import Incidence

__all__ = ["Arena"]


@dataclass(frozen=True, eq=False)
class Arena:
    """A game between a chooser and an opponent.

    Attributes:
        graph: the rows. Whatever leaves the matrix never comes back.
        opposed: the states in which the opponent chooses, bool[n].
        absent: rows that nobody can take, bool[rows]; None: there are none.
    """

    graph: Incidence
    opposed: Bools
    absent: Bools | None = None

    @property
    def reversed(self) -> Arena:
        """The game in which the sides have exchanged their parts."""
        return replace(self, opposed=~self.opposed)

    def into(self, states: Bools) -> Bools:
        """The rows with an entry in some states, bool[rows]."""
        pre, found = self.graph.pre, np.zeros(self.graph.matrix.rows, np.bool_)
        found[self.graph.rows_in[spans(pre[:-1][states], pre[1:][states])]] = True
        return found

    @cached_property
    def _present(self) -> Bools:
        rows = self.graph.matrix.rows
        return np.ones(rows, np.bool_) if self.absent is None else ~self.absent

    def attract(self, rows: Bools, through: Bools) -> tuple[Bools, Int64s]:
        """Where the chooser takes one of some rows with positive probability.

        Args:
            rows: the rows to be taken, bool[rows].
            through: the states that may be passed, bool[n].

        Returns:
            The states, bool[n], and for each of the chooser's a row that is one of them or nears
            such a state (-1 elsewhere), int64[n].
        """
        graph = self.graph
        starts = graph.groups[:-1]
        good = rows & self._present
        some = np.add.reduceat(good, starts, dtype=np.int32)
        every = np.add.reduceat(self._present, starts, dtype=np.int32)
        misses = np.where(self.opposed, every, 1).astype(np.int32) - some
        reached = through & (misses <= 0) & (every > 0)
        witness = np.full(len(reached), -1, np.int64)
        first = np.flatnonzero(good)[::-1]
        witness[graph.owner_of_rows[first]] = first
        partial_search.search(
            graph.pre,
            graph.rows_in,
            graph.owner_of_rows,
            (good | ~self._present).view(np.uint8),
            misses,
            np.ascontiguousarray(through).view(np.uint8),
            np.flatnonzero(reached).astype(np.int32),
            reached.view(np.uint8),
            witness,
        )
        witness[~reached | self.opposed] = -1
        return reached, witness

    def almost_surely(self, rows: Bools, fatal: Bools, within: Bools) -> tuple[Bools, Int64s]:
        """Where the chooser takes one of some rows again and again with probability 1.

        If a row ends the game, where it is taken once. Rows that leave `within` otherwise have to
        be among the fatal ones.

        Args:
            rows: the rows to be taken, bool[rows].
            fatal: the rows that must never be taken, bool[rows].
            within: the states of the game, bool[n].

        Returns:
            As `attract`; elsewhere a row of the opponent's by which that is prevented with positive
            probability.
        """
        spoiling = np.full(len(within), -1, np.int64)
        while True:
            lost, against = self.reversed.attract(fatal, within)
            within = within & ~lost
            fatal = fatal | self.into(lost)
            safe = fatal if self.absent is None else fatal | self.absent
            found, witness = replace(self, absent=safe).attract(rows, within)
            bad = within & ~found
            spoiling = np.where(lost, against, spoiling)
            if not bad.any():
                return found, np.where(found, witness, spoiling)
            # In a bad state of the opponent, some row avoids what is found.
            other = np.flatnonzero(self._present & ~rows & ~self.into(found))[::-1]
            away = np.full(len(within), -1, np.int64)
            away[self.graph.owner_of_rows[other]] = other
            spoiling = np.where(bad & self.opposed, away, spoiling)
            within = within & ~bad
            fatal = fatal | self.into(bad)

    def repeatedly(self, rows: Bools, fatal: Bools) -> tuple[Bools, Int64s]:
        """Where the chooser takes one of some rows again and again with positive probability.

        Rows that leave the matrix have to be among the fatal ones.

        Returns:
            As `attract`.
        """
        arena, left = self, np.ones(len(self.opposed), np.bool_)
        chosen = np.full(len(left), -1, np.int64)
        while True:
            sure, again = arena.almost_surely(rows, fatal, left)
            if not sure.any():
                return ~left, chosen
            near, towards = arena.attract(arena.into(sure), left)
            chosen = np.where(sure, again, np.where(near, towards, chosen))
            won = sure | near
            left = left & ~won
            # The opponent does not enter what is won. The chooser cannot.
            entering = arena.into(won)
            absent = entering if arena.absent is None else entering | arena.absent
            arena = replace(arena, absent=absent)
