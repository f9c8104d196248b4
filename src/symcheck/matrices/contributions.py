"""What each action contributes to the transitions of a chain.

A transition of a DTMC or CTMC sums the probabilities (rates) of all commands that lead from its
source to its target, and these commands may have different actions.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix

__all__ = ["Contributions", "TransitionParts"]


class Contributions(NamedTuple):
    """Weights from sources to targets by action, in any order; the same triple may occur again.

    source, target: numbers of states, int64[k]. action: index of its name, -1 for none, int32[k].
    weight: probability (rate), float64[k] or Fractions.
    """

    source: Int64s
    target: Int64s
    action: Int32s
    weight: Numbers

    def totals(self, matrix: SparseMatrix) -> Numbers:
        """The entries of a matrix, summed from their contributions where there are some."""
        entry, known = matrix.find(self.source, self.target)
        sums = full(matrix.entries, 0, rational=matrix.is_rational)
        np.add.at(sums, entry[known], self.weight[known])
        touched = np.zeros(matrix.entries, bool)
        touched[entry[known]] = True
        return np.where(touched, sums, matrix.data)

    def renumbered(self, number: Int64s) -> Contributions:
        """The contributions after state i is called `number[i]`."""
        return self._replace(source=number[self.source], target=number[self.target])


@dataclass(frozen=True, eq=False)
class TransitionParts:
    """The transitions of a chain, each divided among its actions.

    Attributes:
        entry: the entry of the matrix of which this is a part, ascending, int64[parts].
        action: index of the name, -1 for none, int32[parts]; the parts of an entry are ordered by
            name, and the one without action is the first.
        values: probabilities (rates), float64[parts] or Fractions.
    """

    entry: Int64s
    action: Int32s
    values: Numbers

    @classmethod
    def of(
        cls, matrix: SparseMatrix, contributions: Contributions, names: Sequence[str]
    ) -> TransitionParts:
        """Divide the entries of a chain's matrix; one without contributions has no action.

        A part that is a whole entry has its value; several parts of an entry sum to it up to
        rounding.

        Args:
            matrix: probabilities (rates), a row per state.
            contributions: the contributions, with the state numbers of the matrix.
            names: the action names.
        """
        by_name = np.array([-1, *sorted(range(len(names)), key=names.__getitem__)], np.int32)
        rank = np.empty(len(names) + 1, np.int64)
        rank[by_name] = np.arange(len(by_name))  # by_name[0] = -1 is the last place
        entries, known = matrix.find(contributions.source, contributions.target)
        bare = np.ones(matrix.entries, bool)
        bare[entries[known]] = False
        alone = np.flatnonzero(bare)
        exact = matrix.is_rational
        codes, part = np.unique(
            np.concatenate(
                [entries[known] * len(rank) + rank[contributions.action[known]], alone * len(rank)]
            ),
            return_inverse=True,
        )
        weights = full(len(codes), 0, rational=exact)
        ones = full(len(alone), 1, rational=exact)
        np.add.at(weights, part, np.concatenate([contributions.weight[known], ones]))
        entry = codes // len(rank)
        single = np.bincount(entry, minlength=matrix.entries)[entry] == 1
        values = np.where(single, matrix.data[entry], weights)
        return cls(entry, by_name[codes % len(rank)], values)

    def texts(self, names: Sequence[str]) -> list[str]:
        """The action name of each part; empty for none."""
        with_none = np.array([*names, ""], dtype=object)
        texts_of_parts: list[str] = with_none[self.action].tolist()
        return texts_of_parts

    def joined(self, names: Sequence[str], entries: int) -> list[str]:
        """The action names of each of the matrix' entries, joined by commas; empty for none."""
        actions: list[list[str]] = [[] for _ in range(entries)]
        for entry, text in zip(self.entry.tolist(), self.texts(names), strict=True):
            if text:
                actions[entry].append(text)
        return [", ".join(names) for names in actions]
