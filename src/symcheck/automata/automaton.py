"""Deterministic ω-automata with transition-based generalised Rabin acceptance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from symcheck.matrices.rows import Bools, Int32s

__all__ = ["Automaton", "RabinPair"]

Edges = frozenset[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class RabinPair:
    """Accepts a run that takes `avoid` finitely often and every set in `visits` infinitely often.

    Sets of edges are bool[states, letters].
    """

    avoid: Bools = field(repr=False)
    visits: tuple[Bools, ...] = field(default=(), repr=False)


@dataclass(frozen=True, eq=False)
class Automaton:
    """A complete deterministic automaton, which accepts a run if some pair does.

    table: successor of each state by each letter, int32[states, letters]. A letter is the index of
      a valuation of the atoms; valuations that do not occur may be left out.
    accepting: states from which every word is accepted.
    """

    table: Int32s = field(repr=False)
    initial: int
    pairs: tuple[RabinPair, ...]
    accepting: frozenset[int] = frozenset()

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self.table)

    @property
    def letters(self) -> int:
        """Number of letters."""
        return int(self.table.shape[1])

    def edges(self, chosen: Bools) -> Edges:
        """A set of edges (bool[states, letters]) as pairs (state, letter)."""
        return frozenset((int(q), int(a)) for q, a in zip(*np.nonzero(chosen), strict=True))

    def entering(self, states: frozenset[int]) -> Edges:
        """The edges into a set of states."""
        return self.edges(np.isin(self.table, list(states)))

    def accepts(self, prefix: Sequence[int], period: Sequence[int]) -> bool:
        """Whether the word `prefix` (`period`)^omega is accepted."""
        state = self.initial
        for letter in prefix:
            state = int(self.table[state, letter])
        seen: dict[int, int] = {}
        rounds: list[list[tuple[int, int]]] = []
        while state not in seen:
            seen[state] = len(rounds)
            taken = []
            for letter in period:
                taken.append((state, letter))
                state = int(self.table[state, letter])
            rounds.append(taken)
        cycle = [edge for taken in rounds[seen[state] :] for edge in taken]
        return any(
            not any(pair.avoid[e] for e in cycle)
            and all(any(visit[e] for e in cycle) for visit in pair.visits)
            for pair in self.pairs
        )

    def relabel(self, columns: Sequence[int], letters: int) -> Automaton:
        """The automaton over `letters` letters, with letter i renamed to `columns[i]`.

        The remaining letters occur in no word.
        """
        source = np.zeros(letters, dtype=np.int64)
        source[np.asarray(columns, dtype=np.int64)] = np.arange(len(columns))
        used = np.isin(np.arange(letters), columns)
        pairs = tuple(
            RabinPair(p.avoid[:, source] & used, tuple(v[:, source] & used for v in p.visits))
            for p in self.pairs
        )
        return Automaton(
            np.ascontiguousarray(self.table[:, source]), self.initial, pairs, self.accepting
        )
