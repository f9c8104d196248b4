"""The exploration of a part of a model, in rounds.

A part numbers its states, and the states of other parts that its rows lead to (its ghosts). The
owner of a ghost keeps the list of the ghosts of each other part in their order there. So parts
exchange values without numbers: an array for each pair of parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from symcheck.distributed import tuning
from symcheck.distributed.partition import Partition
from symcheck.errors import ResourceError
from symcheck.explicit.build import row_arrays
from symcheck.explicit.faults import raise_model_fault
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.tables import compile_model
from symcheck.kernels.explore.breadth_first import Explorer, Outcome, malloc_trim
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.semantics.model import BoundModel

__all__ = ["PartExploration", "PartRows"]

_FOREVER = 1e9
_NO_BUDGET = 1 << 62


@dataclass(frozen=True, eq=False)
class PartRows:
    """An explored part with n states, in the order of discovery, and m states with its ghosts.

    Attributes:
        states: uint64[n, words].
        matrix: the rows of the states; probabilities, or rates in a CTMC. Ghosts are its last
            states, by owner, and have no choices, or an empty row.
        starts: int64[parts+1], the first ghost of each owner, and m.
        sent: for each part, the states that are its ghosts: int32.
        deadlocks: bool[n].
        initial: int64, initial states.
        rewards: for each structure, the transition reward of each row, times probability (rate).
    """

    states: Rows = field(repr=False)
    matrix: SparseMatrix = field(repr=False)
    starts: Int64s
    sent: list[Int32s] = field(repr=False)
    deadlocks: Bools = field(repr=False)
    initial: Int64s
    rewards: list[Floats] = field(repr=False)


class PartExploration:
    """A part that is explored.

    Args:
        model: a DTMC, CTMC or MDP with commands.
        number: of this part, from 0.
        known: states of this part that were found before (uint64[n, words]).
    """

    def __init__(
        self,
        model: BoundModel,
        number: int,
        partition: Partition,
        *,
        check_sums: bool = True,
        known: Rows | None = None,
    ) -> None:
        self._model, self._number, self._partition = model, number, partition
        self._check_sums = check_sums
        self.layout = StateLayout.of(model.variables)
        self._explorer = Explorer(
            compile_model(model, self.layout, check_sums=check_sums), None, partition.of(number)
        )
        self._owners: list[Int32s] = []
        self._classified = 0
        self._round_entries = tuning.FIRST_ROUND_ENTRIES
        self.resend()
        initial = initial_rows(model, self.layout)
        self._initial = self._add(initial[partition.owners(initial) == number])
        if known is not None:
            self._add(known)

    def _add(self, rows: Rows) -> Int32s:
        ids = np.empty(len(rows), np.int32)
        self._explorer.states.add(np.ascontiguousarray(rows), ids)
        return ids

    def resend(self) -> None:
        """Begin the exchange anew: ghosts are sent again, and those of others are forgotten."""
        self._sent = 0
        self._exports: list[list[Int32s]] = [[] for _ in range(self._partition.parts)]

    def explore(self, incoming: Sequence[Rows]) -> tuple[bool, list[Rows], Rows]:
        """Number ghosts of the other parts, and expand some states.

        Returns:
            Whether states are left, the new ghosts of each part, and the new states of this part.

        Raises:
            ModelFault: the model breaks a rule in a state.
        """
        for part, rows in enumerate(incoming):
            self._exports[part].append(self._add(rows))
        e = self._explorer
        alone = self._partition.parts == 1
        entries = _NO_BUDGET if alone else min(self._round_entries, tuning.ROUND_ENTRIES)
        self._round_entries *= 2
        outcome = e.run(_NO_BUDGET, _FOREVER, entries=entries)
        if outcome == Outcome.FAULT:
            state = self.layout.unpack(e.states.view_rows()[e.fault_state])
            raise_model_fault(self._model, state, e.fault_status, check_sums=self._check_sums)
        if outcome == Outcome.NO_MEMORY:
            raise MemoryError
        if outcome == Outcome.TOO_MANY:
            raise ResourceError("a part has more than 2**31 - 1 states; more workers are needed")
        rows = e.states.view_rows()
        new = rows[self._classified :]
        owners = self._partition.owners(new)
        own = new[owners == self._number]
        self._owners.append(owners)
        if self._sent < self._classified:
            owners = self._owner_of_all()[self._sent :]
        unsent = rows[self._sent :]
        outgoing = [
            unsent[owners == (p if p != self._number else -1)] for p in range(self._partition.parts)
        ]
        self._sent = self._classified = len(rows)
        return e.explored < len(rows), outgoing, own

    def _owner_of_all(self) -> Int32s:
        self._owners = [np.concatenate(self._owners)]
        return self._owners[0]

    def finish(self) -> PartRows:
        """The rows of the part, after the exploration. It can be called once."""
        e, parts = self._explorer, self._partition.parts
        owners, total = self._owner_of_all(), len(e.states)
        e.states.drop_table()
        rows = e.states.view_rows()
        own = np.flatnonzero(owners == self._number)
        others = np.flatnonzero(owners != self._number)
        ghosts = others[np.argsort(owners[others], kind="stable")]
        order = np.concatenate([own, ghosts]).astype(np.int32)
        rank = np.empty(total, np.int32)
        rank[order] = np.arange(total, dtype=np.int32)
        states = rows[own]
        e.states.drop_rows()
        counts = np.bincount(owners[others], minlength=parts)
        deadlocks = np.zeros(len(own), np.bool_)
        deadlocks[rank[e.deadlocks]] = True
        matrix, _, rewards = row_arrays(e.rows, order, rank, self._model)
        malloc_trim()
        return PartRows(
            states,
            matrix,
            len(own) + starts_of(counts),
            [rank[np.concatenate([np.empty(0, np.int32), *ids])] for ids in self._exports],
            deadlocks,
            np.sort(rank[self._initial].astype(np.int64)),
            rewards,
        )
