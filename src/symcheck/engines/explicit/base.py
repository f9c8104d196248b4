"""The common part of explicit engines: one matrix row per choice, and sets as bool arrays."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from symcheck.engines.capabilities import Capable, HasMatrix
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.explicit.rational_values import RationalValues
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix

__all__ = ["Enumerated", "Numeric"]

Numeric = ArrayValues | RationalValues
"""Values of one of the two types of number."""


class Enumerated(Capable, HasMatrix):
    """Sizes and sets of an engine over the rows of `matrix` (see `engines.base.Engine`)."""

    @property
    def matrix(self) -> SparseMatrix:
        """One-step probabilities (rates), deadlocks fixed, as doubles."""
        raise NotImplementedError

    @property
    def states(self) -> int:
        """Number of reachable states."""
        return self.matrix.states

    @property
    def transitions(self) -> int:
        """Number of stored transitions."""
        return self.matrix.entries

    @property
    def choices(self) -> int:
        """Number of choices (states, where there is no nondeterminism)."""
        return self.matrix.rows

    @cached_property
    def all(self) -> ArraySet:
        """Every reachable state."""
        return ArraySet(np.ones(self.states, bool))

    @cached_property
    def none(self) -> ArraySet:
        """The empty set."""
        return ArraySet(np.zeros(self.states, bool))

    def from_bools(self, members: Bools) -> ArraySet:
        """The states at which the array (in index order) is True."""
        return ArraySet(np.asarray(members, dtype=bool))

    def to_bools(self, states: ArraySet) -> Bools:
        """Membership of each state, in index order."""
        return states.members

    def numbers(self, states: ArraySet, limit: int | None = None, start: int = 0) -> Int64s:
        """The index of each state of a set."""
        return np.flatnonzero(states.members)[start:][:limit]

    def first(self, states: ArraySet) -> ArraySet:
        """The singleton of the state with the lowest index."""
        return self._of(np.array([int(np.argmax(states.members))]))

    def _of(self, indices: Int64s) -> ArraySet:
        members = np.zeros(self.states, bool)
        members[indices] = True
        return ArraySet(members)
