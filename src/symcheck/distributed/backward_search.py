"""Backward search on a part of a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.distributed.messages import Boundary, Message
from symcheck.kernels.arrays import Masks
from symcheck.kernels.graph.partial_search import search
from symcheck.matrices.rows import Bools, Int32s, Int64s

__all__ = ["BackwardSearch"]


class BackwardSearch:
    """The states of a part from which a set is reached over states of another.

    Args:
        boundary: of the part.
        columns: the transposed structure.
        row_state: int32[rows].
        source: the set; it becomes `reached`.
        through: the other set.
        hit: uint8[rows], nonzero for choices that do not count; then, for those that may lead to
            reached states.
        every_choice: a state is reached if all of its choices may lead to reached states.

    Attributes:
        reached: bool[states].
    """

    def __init__(
        self,
        boundary: Boundary,
        columns: tuple[Int64s, Int32s],
        row_state: Int32s,
        source: Bools,
        through: Bools,
        hit: Masks,
        every_choice: bool,
    ) -> None:
        self._boundary, self._columns, self._row_state = boundary, columns, row_state
        self._through, self._reached, self.hit = through.view(np.uint8), source.view(np.uint8), hit
        self._misses = None
        if every_choice:
            misses = np.bincount(row_state[hit == 0], minlength=len(source))
            self._misses = misses.astype(np.int32)
        self._told = [np.zeros(len(sent), np.bool_) for sent in boundary.sent]
        self._extend(np.flatnonzero(self._reached).astype(np.int32))

    @property
    def reached(self) -> Bools:
        """The states that are reached: bool[states]."""
        return self._reached.view(np.bool_)

    def _extend(self, found: Int32s) -> None:
        search(
            *self._columns,
            self._row_state,
            self.hit,
            self._misses,
            self._through,
            found,
            self._reached,
        )

    def go_on(self, incoming: Sequence[Message]) -> None:
        """Go on from the ghosts that are reached."""
        ghosts = self._boundary.ghosts(incoming)
        new = ghosts[self._reached[ghosts] == 0]
        self._reached[new] = 1
        self._extend(new)

    def messages(self) -> list[Message]:
        """The states that are reached and that the others do not know."""
        return self._boundary.of_new(self.reached, self._told)
