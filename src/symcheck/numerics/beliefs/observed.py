"""Markov decision processes whose strategies see observations, as arrays of whole numbers.

Source: Kaelbling, Littman & Cassandra (1998), 'Planning and acting in partially observable
stochastic domains'.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.matrices.numbers import Numbers, Rationals
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, spans, starts_of

__all__ = ["GOAL", "SINK", "Observed", "Whole", "aligned_rows", "gathered"]

Whole = NDArray[Any]
"""Whole numbers: int64, or Python's where they are large."""

GOAL, SINK = 0, 1
"""The classes of states whose value no strategy changes: 1 (or nothing is earned), and 0."""

LARGEST = 2**62
"""Whole numbers below it are kept as int64."""


def gathered(
    rows: Int64s, columns: Int64s, values: Numbers, owner: Int64s, states: int
) -> SparseMatrix:
    """The matrix of some entries; those in the same place are added.

    Args:
        rows: the row of each entry.
        columns: its column.
        values: its value.
        owner: the state of each row, ascending.
        states: their number, which is that of the columns.
    """
    order = np.lexsort((columns, rows))
    split = SparseMatrix(
        starts_of(np.bincount(rows, minlength=len(owner))),
        columns[order].astype(np.int32),
        values[order],
        states,
        starts_of(np.bincount(owner, minlength=states)),
    )
    return split.merge(np.arange(states, dtype=np.int32), states)


def aligned_rows(
    groups: Int64s, observation: Int32s, actions: Int32s
) -> tuple[Int64s, tuple[int, int] | None]:
    """The rows of each state in the order of the actions of its observation.

    Choices with the same action are told apart by their order.

    Args:
        groups: where the rows of each state begin, int64[n+1].
        observation: of each state, from 0, int32[n].
        actions: of each row, -1 for none, int32[rows].

    Returns:
        A permutation of the rows within states, and two states with the same observation that do
        not have the same actions; None if there are none.
    """
    counts = np.diff(groups)
    owner = np.repeat(np.arange(len(counts)), counts)
    rows = np.lexsort((np.arange(len(owner)), actions, owner))
    _, first = np.unique(observation, return_index=True)
    leader = first[observation]
    differ = counts != counts[leader]
    if not differ.any():
        of_leader = spans(groups[leader], groups[leader + 1])
        wrong = actions[rows] != actions[rows[of_leader]]
        differ[owner[wrong]] = True
    if differ.any():
        state = int(np.argmax(differ))
        return rows, (int(leader[state]), state)
    return rows, None


@dataclass(frozen=True, eq=False)
class Observed:
    """A model with observations.

    Attributes:
        matrix: the probabilities as doubles; row groups[s] + j is the j-th choice of the
            observation of s.
        origin: the row of the model of each of these rows, int64[rows].
        numerators: probabilities times `denominators[slot]`, per entry.
        denominators: one for each choice of each observation.
        observation: of each state, int32[n], from 0.
        classes: the observation + 2; GOAL and SINK where no strategy changes the value.
    """

    matrix: SparseMatrix = field(repr=False)
    origin: Int64s = field(repr=False)
    numerators: Whole = field(repr=False)
    denominators: Whole = field(repr=False)
    observation: Int32s = field(repr=False)
    classes: Int64s = field(repr=False)

    @classmethod
    def of(cls, matrix: SparseMatrix, rows: Int64s, observation: Int32s) -> Observed:
        """The model with a matrix of rationals and its aligned rows."""
        aligned = matrix.choose(rows, matrix.groups)
        assert aligned.groups is not None
        base = cls(
            aligned.doubles(),
            rows,
            np.zeros(0),
            np.zeros(0),
            observation,
            observation + np.int64(2),
        )
        data: Rationals = aligned.data
        slot = base.first_slot[observation][aligned.state_of_row] + base.position
        of_entry = np.repeat(slot, aligned.lengths)
        below = np.array([p.denominator for p in data], object)
        above = np.array([p.numerator for p in data], object)
        order = np.argsort(of_entry, kind="stable")
        starts = starts_of(np.bincount(of_entry, minlength=int(base.first_slot[-1])))[:-1]
        common = np.lcm.reduceat(below[order], starts)
        above = above * (common[of_entry] // below)
        return replace(base, numerators=_small(above), denominators=_small(common))

    @property
    def groups(self) -> Int64s:
        """Where the rows of each state begin."""
        assert self.matrix.groups is not None
        return self.matrix.groups

    @property
    def states(self) -> int:
        """The number of states."""
        return self.matrix.states

    @cached_property
    def position(self) -> Int64s:
        """The number of each row within its state."""
        return np.arange(self.matrix.rows) - np.repeat(self.groups[:-1], np.diff(self.groups))

    @cached_property
    def choices(self) -> Int64s:
        """The number of choices of each observation."""
        _, first = np.unique(self.observation, return_index=True)
        return np.diff(self.groups)[first]

    @cached_property
    def first_slot(self) -> Int64s:
        """The number of the first choice of each observation among all of them."""
        return starts_of(self.choices)

    @cached_property
    def by_class(self) -> Int64s:
        """The states by class."""
        return np.lexsort((np.arange(self.states), self.classes))

    @cached_property
    def rank(self) -> Int64s:
        """The place of each state in `by_class`."""
        out = np.empty(self.states, np.int64)
        out[self.by_class] = np.arange(self.states)
        return out

    def settled(self, goal: Bools, sink: Bools) -> Observed:
        """The model with other states whose value no strategy changes."""
        classes = self.observation + np.int64(2)
        classes[goal], classes[sink] = GOAL, SINK
        return replace(self, classes=classes)


def _small(values: Whole) -> Whole:
    return values.astype(np.int64) if max(values, default=0) < LARGEST else values
