"""A Markov chain that is made as far as sampled paths go: states are expanded when a path first enters them.

What is known is kept in arrays, so that a step of many paths at once is a look-up. It is forgotten when it grows beyond
a limit: a chain of any size can be sampled.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import ModelFault
from symcheck.explicit.states import Layout, Rows
from symcheck.kernels.tables.state_table import StateSet
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics import state_faults
from symcheck.semantics.model import BoundModel
from symcheck.simulate.state_predicates import Atom
from symcheck.simulate.transition_sampler import Expander
from symcheck.syntax.ast import ModelType

__all__ = ["Chain"]

LIMIT = 1 << 25
"""Branches that are kept at most: about 1 GB."""


class _Growing:
    """An array that grows by doubling along its first axis; places that nobody wrote to hold `fill`."""

    def __init__(self, dtype: type, fill: float = 0, width: tuple[int, ...] = ()) -> None:
        self.fill = fill
        self.data: NDArray[Any] = np.full((1024, *width), fill, dtype)

    def reserve(self, size: int) -> None:
        """Make room for so many."""
        if size > len(self.data):
            grown = np.full(
                (max(size, 2 * len(self.data)), *self.data.shape[1:]), self.fill, self.data.dtype
            )
            grown[: len(self.data)] = self.data
            self.data = grown


class Chain:
    """States of a model by number; `expand` makes sure that their branches are known. Numbers hold until `forget`.

    structure: the reward structure whose rewards are wanted. atoms: state formulas; `truth(i)` tells where they hold.
    An MDP is sampled with all choices equally likely. Deadlocks have a loop, or (fix_deadlocks False) are an error.
    """

    def __init__(
        self,
        model: BoundModel,
        structure: int | None = None,
        atoms: tuple[Atom, ...] = (),
        *,
        fix_deadlocks: bool = True,
        limit: int = LIMIT,
    ) -> None:
        self.model, self.limit = model, limit
        self.continuous = model.type is ModelType.CTMC
        self._atoms, self._fix = atoms, fix_deadlocks
        self._expander = Expander(model, structure)
        self._layout = Layout.of(model.variables)
        self._begin()

    def _begin(self) -> None:
        self._set = StateSet(self._layout.words)
        self._rows = _Growing(np.uint64, width=(self._layout.words,))
        self._start, self._length = _Growing(np.int64, -1), _Growing(np.int32)
        self._stuck = _Growing(np.bool_)
        self._rate, self._reward = _Growing(np.float64), _Growing(np.float64)
        self._truth = [_Growing(np.bool_) for _ in self._atoms]
        self._targets, self._cumulative, self._earned = (
            _Growing(np.int32),
            _Growing(np.float64),
            _Growing(np.float64),
        )
        self._branches = 0

    def __len__(self) -> int:
        return len(self._set)

    def __repr__(self) -> str:
        return f"Chain({len(self)} states known, {self._branches} branches)"

    # -------------------------------------------------------------------------------------------- states

    def add(self, rows: Rows) -> Int32s:
        """The numbers of packed states: int32[n]."""
        ids = np.empty(len(rows), np.int32)
        self._set.add(np.ascontiguousarray(rows), ids)
        for array in (
            self._rows,
            self._start,
            self._length,
            self._rate,
            self._reward,
            self._stuck,
            *self._truth,
        ):
            array.reserve(len(self))
        self._rows.data[ids] = rows
        return ids

    def expand(self, ids: Int32s) -> Int32s:
        """See to it that these states are expanded; gives their numbers, which change where the chain was forgotten."""
        new = np.unique(ids[self._start.data[ids] < 0])
        if not len(new):
            return ids
        if self._branches > self.limit:
            ids = self._forget(ids)
            new = np.unique(ids)
        self._expand(new)
        return ids

    def complete(self, budget: int) -> None:
        """Expand what is known and was never entered, and what it leads to, as long as no more than `budget` states are known."""
        while len(self) <= budget and len(
            new := np.flatnonzero(self._start.data[: len(self)] < 0).astype(np.int32)
        ):
            self._expand(new)

    def _forget(self, ids: Int32s) -> Int32s:
        """Begin again with these states only."""
        kept = self._rows.data[ids]
        self._begin()
        return self.add(kept)

    def _expand(self, new: Int32s) -> None:
        rows = self._rows.data[new]
        columns = np.stack([self._layout.column(rows, v) for v in range(len(self.model.variables))])
        found = self._expander.successors(columns)
        if not self._fix and found.deadlock.any():
            example = state_faults.describe_state(
                self.model.variables, columns[:, found.deadlock][:, 0].tolist()
            )
            raise ModelFault(state_faults.deadlocks([example], int(found.deadlock.sum())))
        targets = self.add(self._layout.pack(list(found.columns)))
        self._start.data[new] = found.offsets[:-1] + self._branches
        self._length.data[new] = np.diff(found.offsets)
        self._rate.data[new] = np.add.reduceat(found.weights, found.offsets[:-1])
        self._reward.data[new] = self._expander.state_rewards(columns)
        for atom, truth in zip(self._atoms, self._truth, strict=True):
            truth.data[new] = atom(columns, found.deadlock)
        elsewhere = targets != np.repeat(new, np.diff(found.offsets))
        self._stuck.data[new] = ~np.logical_or.reduceat(elsewhere, found.offsets[:-1])
        self._append(targets, _cumulative(found.weights, found.offsets), found.rewards)

    def _append(self, targets: Int32s, cumulative: Floats, earned: Floats) -> None:
        begin, end = self._branches, self._branches + len(targets)
        for array, values in (
            (self._targets, targets),
            (self._cumulative, cumulative),
            (self._earned, earned),
        ):
            array.reserve(end)
            array.data[begin:end] = values
        self._branches = end

    # -------------------------------------------------------------------------------------------- looking up

    def truth(self, number: int, ids: Int32s) -> Bools:
        """Where atom `number` holds, of states that are expanded."""
        return np.asarray(self._truth[number].data[ids])

    def stuck(self, ids: Int32s) -> Bools:
        """Which states, of states that are expanded, lead nowhere but to themselves."""
        return np.asarray(self._stuck.data[ids])

    def rate(self, ids: Int32s) -> Floats:
        """Rates at which these states are left (in discrete time: the sum of the probabilities)."""
        return np.asarray(self._rate.data[ids])

    def reward(self, ids: Int32s) -> Floats:
        """State rewards."""
        return np.asarray(self._reward.data[ids])

    def choose(self, ids: Int32s, uniform: Floats) -> Int64s:
        """A branch for each of these states, by numbers that are uniform on [0, 1): inversion, by bisection in the row."""
        low: Int64s = self._start.data[ids].copy()
        high = low + self._length.data[ids] - 1
        while (low < high).any():
            middle = (low + high) >> 1
            beyond = self._cumulative.data[middle] <= uniform
            low, high = np.where(beyond, middle + 1, low), np.where(beyond, high, middle)
        return low

    def follow(self, branches: Int64s) -> tuple[Int32s, Floats]:
        """Where branches lead to, and what they earn."""
        return np.asarray(self._targets.data[branches]), np.asarray(self._earned.data[branches])

    def graph(self) -> tuple[SparseMatrix, Bools]:
        """Which state leads to which, as far as it is known (weights are meaningless), and which states are expanded."""
        n = len(self)
        expanded = self._start.data[:n] >= 0
        indptr = np.concatenate([[0], np.cumsum(self._length.data[:n])]).astype(np.int64)
        places = np.repeat(self._start.data[:n] - indptr[:-1], self._length.data[:n]) + np.arange(
            indptr[-1]
        )
        indices = np.ascontiguousarray(self._targets.data[places], np.int32)
        return SparseMatrix(indptr, indices, np.ones(len(indices)), n), expanded


def _cumulative(weights: Floats, offsets: Int64s) -> Floats:
    """Running sums in each row, relative to the row's total; the last one is beyond all that is asked."""
    result = np.empty(len(weights))
    totals = np.add.reduceat(weights, offsets[:-1])
    running = np.zeros(len(totals))
    length = np.diff(offsets)
    for place in range(int(length.max(initial=0))):
        rows = np.flatnonzero(length > place)
        running[rows] += weights[offsets[rows] + place]
        result[offsets[rows] + place] = running[rows] / totals[rows]
    result[offsets[1:] - 1] = 2.0
    return result
