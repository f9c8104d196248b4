"""Sets of states of a part, and searches from them over all parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from symcheck.distributed.backward_search import BackwardSearch
from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.messages import Message
from symcheck.kernels.arrays import Masks
from symcheck.matrices.rows import Bools
from symcheck.simulate.state_predicates import compile_predicate
from symcheck.syntax.ast import Expression

__all__ = ["StateSets"]


class StateSets:
    """The sets of states of a part, ghosts included, by name: bool[states and ghosts].

    The sets `left` and `right` satisfy two state formulas; `through` are the states of `left` and
    not `right`.
    """

    def __init__(
        self,
        part: ExploredPart,
        left: Expression,
        right: Expression,
        labels: Mapping[str, Expression],
    ) -> None:
        self._part, self._sets = part, dict[str, Bools]()
        self._bits = np.zeros(part.total, np.uint8)
        for bit, formula in enumerate((left, right)):
            holds = compile_predicate(formula, part.model, part.layout, labels)
            members = np.asarray(holds(part.rows.states, part.rows.deadlocks), np.bool_)
            self._bits[: part.own] |= members.astype(np.uint8) << np.uint8(bit)
        self._search: BackwardSearch | None = None

    def __getitem__(self, name: str) -> Bools:
        return self._sets[name]

    def __setitem__(self, name: str, members: Bools) -> None:
        self._sets[name] = members

    @property
    def search(self) -> BackwardSearch:
        """The search that was begun last."""
        assert self._search is not None
        return self._search

    def messages(self) -> list[Message]:
        """The states that satisfy the two formulas."""
        return self._part.boundary.all(self._bits)

    def receive(self, incoming: Sequence[Message]) -> None:
        """Complete the sets by the ghosts."""
        self._part.boundary.receive(self._bits, incoming)
        left, right = (self._bits & 1).astype(np.bool_), (self._bits & 2).astype(np.bool_)
        self._sets |= {"left": left, "right": right, "through": left & ~right}

    def complement(self, name: str, *excluded: str) -> None:
        """Keep the states that are in none of some sets as a set."""
        self._sets[name] = ~np.logical_or.reduce([self._sets[e] for e in excluded])

    def members(self, name: str) -> tuple[int, int]:
        """How many initial states of this part are in a set, and how many states."""
        members = self._sets[name][: self._part.own]
        return int(members[self._part.rows.initial].sum()), int(members.sum())

    def begin_search(
        self, source: str, through: str, every_choice: bool, inside: str | None = None
    ) -> list[Message]:
        """Begin a backward search from a set, over states of another.

        every_choice: a state is reached if all of its choices may lead to reached states.
        inside: only choices count whose successors are all in this set.
        """
        matrix = self._part.matrix
        hit = np.zeros(matrix.rows, np.uint8)
        if inside is not None:
            hit |= matrix.multiply((~self._sets[inside]).astype(np.float64)) > 0
        return self.begin(self._sets[source].copy(), self._sets[through], hit, every_choice)

    def begin(self, source: Bools, through: Bools, hit: Masks, every_choice: bool) -> list[Message]:
        """Begin a backward search (see `BackwardSearch`)."""
        part = self._part
        self._search = BackwardSearch(
            part.boundary, part.columns, part.row_state, source, through, hit, every_choice
        )
        return self._search.messages()

    def continue_search(self, incoming: Sequence[Message]) -> list[Message]:
        """Go on from the ghosts that are reached."""
        self.search.go_on(incoming)
        return self.search.messages()

    def end_search(self, name: str) -> None:
        """Keep the reached states as a set."""
        self._sets[name] = self.search.reached
