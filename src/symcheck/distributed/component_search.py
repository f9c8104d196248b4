"""The search for the end components of a distributed model, by the parts in turn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.distributed.end_components import CollapsedComponents, StayingRows
from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.iteration import Iteration
from symcheck.distributed.messages import Message
from symcheck.distributed.state_sets import StateSets
from symcheck.matrices.rows import Int32s, Int64s

__all__ = ["ComponentSearch"]


class ComponentSearch:
    """What a part contributes to the end components of the unknowns: a backward search, whose end
    leaves the set `staying`, numbers of its states, its rows between them, and their components.
    """

    def __init__(self, part: ExploredPart, sets: StateSets, iteration: Iteration) -> None:
        self._part, self._sets, self._iteration = part, sets, iteration
        self._numbers = np.full(part.total, -1, np.int32)
        self._components = np.full(part.total, -1, np.int32)

    def begin(self) -> list[Message]:
        """Begin the search for states that must leave the choices of unknowns without reward.

        Choices that only lead back to their state are left out: sweeps do not take them.
        """
        part, unknown, constant = self._part, self._sets["unknown"], self._iteration.constant
        matrix = part.matrix
        excluded = matrix.lengths == 1
        successors = matrix.indices[matrix.indptr[:-1][excluded]]
        excluded[excluded] = successors == part.row_state[excluded]
        if constant is not None:
            excluded |= constant > 0
        free = np.bincount(part.row_state[~excluded], minlength=part.total)
        source = ~unknown | (free == 0)
        source[part.own :] = ~unknown[part.own :]
        return self._sets.begin(source, unknown, excluded.view(np.uint8), True)

    @property
    def _staying(self) -> Int64s:
        """The own states of the set `staying`."""
        return np.flatnonzero(self._sets["staying"][: self._part.own])

    def number_states(self, firsts: Sequence[int]) -> list[Message]:
        """Number the own states of `staying`, from the first number of this part."""
        own = self._staying
        self._numbers[own] = firsts[self._part.number] + np.arange(len(own))
        return self._part.boundary.all(self._numbers)

    def rows(self, incoming: Sequence[Message]) -> StayingRows:
        """The choices without a reward that lead to states of `staying` only."""
        part = self._part
        part.boundary.receive(self._numbers, incoming)
        own = self._staying
        rows = np.flatnonzero((self._sets.search.hit == 0) & self._sets["staying"][part.row_state])
        matrix = part.matrix.choose(rows)
        choices = np.bincount(part.row_state[rows], minlength=part.own)[own]
        return StayingRows(choices, matrix.lengths, self._numbers[matrix.indices])

    def number_components(self, given: Sequence[Int32s]) -> list[Message]:
        """Take the components of the own states of `staying` (-1 for none)."""
        (components,) = given
        self._components[self._staying] = components
        return self._part.boundary.all(self._components)

    def collapse(self, incoming: Sequence[Message], count: int) -> None:
        """Let the values of components come from all parts, instead of sweeps."""
        part, iteration = self._part, self._iteration
        part.boundary.receive(self._components, incoming)
        iteration.collapsed = CollapsedComponents(
            part.matrix, part.row_state, self._components, count, iteration.constant
        )
        iteration.unknown_own &= self._components < 0
