"""A Markov chain whose states are expanded when a sampled path first enters them.

States, branches and cumulative probabilities are kept in arrays, so that one step of many paths is
a look-up. The arrays are dropped when they exceed a limit, so that a model of any size can be
sampled in bounded memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import ModelFault
from symcheck.explicit.states import Rows
from symcheck.kernels.explore.breadth_first import StateSet
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics import state_faults
from symcheck.simulate import tuning
from symcheck.simulate.sources import Source
from symcheck.simulate.state_predicates import StatePredicate

__all__ = ["LazyChain"]


class _GrowingArray:
    """An array that doubles along its first axis when it is full; unwritten entries hold `fill`."""

    def __init__(self, dtype: type, fill: float = 0, width: tuple[int, ...] = ()) -> None:
        self.fill = fill
        self.data: NDArray[Any] = np.full((1024, *width), fill, dtype)

    def reserve(self, size: int) -> None:
        """Make room for `size` entries."""
        if size > len(self.data):
            grown = np.full(
                (max(size, 2 * len(self.data)), *self.data.shape[1:]), self.fill, self.data.dtype
            )
            grown[: len(self.data)] = self.data
            self.data = grown


class LazyChain:
    """The chain of a model, with numbered states that are expanded on demand.

    State numbers are valid until `expand` drops the chain and returns new numbers. The choices of
    an MDP are equally likely.

    Args:
        source: the states and their successors.
        predicates: state predicates; `satisfies(i, ids)` tells where number i holds.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.
        max_branches: branches beyond which the chain is dropped and begun again.
    """

    def __init__(
        self,
        source: Source,
        predicates: tuple[StatePredicate, ...] = (),
        *,
        fix_deadlocks: bool = True,
        max_branches: int = tuning.MAX_BRANCHES,
    ) -> None:
        self.source, self.max_branches = source, max_branches
        self.continuous = source.model.type.continuous_time
        self._predicates, self._fix_deadlocks = predicates, fix_deadlocks
        self._begin()

    def _begin(self) -> None:
        self._numbers = StateSet(self.source.words)
        self._rows = _GrowingArray(np.uint64, width=(self.source.words,))
        self._start, self._length = _GrowingArray(np.int64, -1), _GrowingArray(np.int32)
        self._absorbing = _GrowingArray(np.bool_)
        self._rate, self._reward = _GrowingArray(np.float64), _GrowingArray(np.float64)
        self._satisfied = [_GrowingArray(np.bool_) for _ in self._predicates]
        self._targets, self._cumulative, self._earned = (
            _GrowingArray(np.int32),
            _GrowingArray(np.float64),
            _GrowingArray(np.float64),
        )
        self._branches = 0

    def __len__(self) -> int:
        return len(self._numbers)

    def __repr__(self) -> str:
        return f"LazyChain({len(self)} states known, {self._branches} branches)"

    # --------------------------------------------------------------------------------------- states

    def add(self, rows: Rows) -> Int32s:
        """The numbers of packed states: int32[n]."""
        ids = np.empty(len(rows), np.int32)
        self._numbers.add(np.ascontiguousarray(rows), ids)
        for array in (
            self._rows,
            self._start,
            self._length,
            self._rate,
            self._reward,
            self._absorbing,
            *self._satisfied,
        ):
            array.reserve(len(self))
        self._rows.data[ids] = rows
        return ids

    def states(self, ids: Int32s) -> Rows:
        """The packed states with these numbers: uint64[n, words]."""
        return np.asarray(self._rows.data[ids])

    def expand(self, ids: Int32s) -> Int32s:
        """Expand the states that are not yet expanded.

        Returns:
            The numbers of the states, int32[n]; they change if the chain was dropped.
        """
        new = np.unique(ids[self._start.data[ids] < 0])
        if not len(new):
            return ids
        if self._branches > self.max_branches:
            kept = self.states(ids)
            self._begin()
            ids = self.add(kept)
            new = np.unique(ids)
        self._expand(new)
        return ids

    def explore(self, max_states: int) -> None:
        """Expand all known states and their successors, breadth first, until more than `max_states`
        states are known.
        """
        while len(self) <= max_states and len(
            new := np.flatnonzero(self._start.data[: len(self)] < 0).astype(np.int32)
        ):
            self._expand(new)

    @property
    def is_complete(self) -> bool:
        """Whether every known state is expanded, so that there are no other states."""
        return bool((self._start.data[: len(self)] >= 0).all())

    def _expand(self, new: Int32s) -> None:
        rows = self.states(new)
        successors = self.source.successors(rows)
        offsets, deadlocks = successors.offsets, successors.deadlocks
        if not self._fix_deadlocks and deadlocks.any():
            example = self.source.text(rows[np.argmax(deadlocks)])
            raise ModelFault(state_faults.deadlocks([example], int(deadlocks.sum())))
        targets = self.add(successors.targets)
        self._start.data[new] = offsets[:-1] + self._branches
        self._length.data[new] = np.diff(offsets)
        self._rate.data[new] = np.add.reduceat(successors.weights, offsets[:-1])
        self._reward.data[new] = self.source.state_rewards(rows)
        for predicate, satisfied in zip(self._predicates, self._satisfied, strict=True):
            satisfied.data[new] = predicate(rows, deadlocks)
        elsewhere = targets != np.repeat(new, np.diff(offsets))
        self._absorbing.data[new] = ~np.logical_or.reduceat(elsewhere, offsets[:-1])
        self._append(targets, _cumulative(successors.weights, offsets), successors.rewards)

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

    # ----------------------------------------------------------------------------------- look-up

    def satisfies(self, number: int, ids: Int32s) -> Bools:
        """Which of these expanded states satisfy predicate `number`: bool[n]."""
        return np.asarray(self._satisfied[number].data[ids])

    def absorbing(self, ids: Int32s) -> Bools:
        """Which of these expanded states have no successor but themselves: bool[n]."""
        return np.asarray(self._absorbing.data[ids])

    def rate(self, ids: Int32s) -> Floats:
        """Exit rates (in discrete time: the sums of the probabilities): float64[n]."""
        return np.asarray(self._rate.data[ids])

    def reward(self, ids: Int32s) -> Floats:
        """State rewards: float64[n]."""
        return np.asarray(self._reward.data[ids])

    def sample(self, ids: Int32s, uniform: Floats) -> Int64s:
        """A random branch of each of these states, by inversion of its distribution.

        Args:
            ids: numbers of expanded states, int32[n].
            uniform: float64[n], numbers drawn uniformly from [0, 1).

        Returns:
            Numbers of branches, int64[n].
        """
        low: Int64s = self._start.data[ids].copy()
        high = low + self._length.data[ids] - 1
        while (low < high).any():
            middle = (low + high) >> 1
            beyond = self._cumulative.data[middle] <= uniform
            low, high = np.where(beyond, middle + 1, low), np.where(beyond, high, middle)
        return low

    def follow(self, branches: Int64s) -> tuple[Int32s, Floats]:
        """Target states and transition rewards of branches: int32[n], float64[n]."""
        return np.asarray(self._targets.data[branches]), np.asarray(self._earned.data[branches])

    def graph(self) -> tuple[SparseMatrix, Bools]:
        """The known transitions, of weight 1, and which states are expanded (bool[states])."""
        n = len(self)
        expanded = self._start.data[:n] >= 0
        indptr, branches = self._rows_of_branches()
        indices = np.ascontiguousarray(self._targets.data[branches], np.int32)
        return SparseMatrix(indptr, indices, np.ones(len(indices)), n), expanded

    def earned(self) -> Floats:
        """The rewards of the transitions in `graph`: float64[transitions]."""
        return np.asarray(self._earned.data[self._rows_of_branches()[1]])

    def _rows_of_branches(self) -> tuple[Int64s, Int64s]:
        """Where the branches of each state begin in a list of all of them, and that list."""
        n = len(self)
        indptr = np.concatenate([[0], np.cumsum(self._length.data[:n])]).astype(np.int64)
        branches = np.repeat(self._start.data[:n] - indptr[:-1], self._length.data[:n]) + np.arange(
            indptr[-1]
        )
        return indptr, branches


def _cumulative(weights: Floats, offsets: Int64s) -> Floats:
    """The cumulative distribution of each row.

    The last entry of a row is 2, so that rounding never selects a branch beyond the row.
    """
    result = np.empty(len(weights))
    totals = np.add.reduceat(weights, offsets[:-1])
    running = np.zeros(len(totals))
    length = np.diff(offsets)
    for position in range(int(length.max(initial=0))):
        rows = np.flatnonzero(length > position)
        running[rows] += weights[offsets[rows] + position]
        result[offsets[rows] + position] = running[rows] / totals[rows]
    result[offsets[1:] - 1] = 2.0
    return result
