"""The part of a model after its exploration: what all of its computations read."""

from __future__ import annotations

from functools import cached_property
from typing import assert_never

import numpy as np

from symcheck.direction import Direction
from symcheck.distributed.checkpoints import PartFiles
from symcheck.distributed.exploration import PartRows
from symcheck.distributed.messages import Boundary
from symcheck.errors import UnsupportedError
from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import StateLayout
from symcheck.explicit.tables import total_reward
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Steps, Structure, Time
from symcheck.semantics.state_faults import describe_state

__all__ = ["ExploredPart"]


class ExploredPart:
    """The states and rows of a part.

    Args:
        model: a DTMC, CTMC or MDP with commands.
        number: of the part, from 0.
        rows: of its states.
        files: of its checkpoints; None: it has none.

    Attributes:
        boundary: sends values of states that are ghosts elsewhere, and receives those of ghosts.
        own: the number of its states, which come before the ghosts.
        total: the number of its states and ghosts.
    """

    def __init__(
        self,
        model: BoundModel,
        number: int,
        layout: StateLayout,
        rows: PartRows,
        files: PartFiles | None,
    ) -> None:
        self.model, self.number, self.layout, self.rows = model, number, layout, rows
        self.matrix, self.files = rows.matrix, files
        self.boundary = Boundary(rows)
        self.own, self.total = len(rows.states), int(rows.starts[-1])

    @cached_property
    def columns(self) -> tuple[Int64s, Int32s]:
        """The transposed structure, which bounded properties do without."""
        return sparse.transpose(self.matrix.indptr, self.matrix.indices, self.total)

    @cached_property
    def row_state(self) -> Int32s:
        """The state of each row: int32[rows]."""
        return self.matrix.state_of_row.astype(np.int32)

    @property
    def continuous_time(self) -> bool:
        """Whether the entries of the rows are rates."""
        return self.model.type.continuous_time

    def mode(self, direction: Direction | None) -> int:
        """The kernels' code for a direction."""
        if self.matrix.groups is None:
            return 0
        return 2 if direction is Direction.MAX else 1

    def deadlock_examples(self) -> list[str]:
        """The first deadlock states of this part, as texts."""
        found = self.rows.states[np.flatnonzero(self.rows.deadlocks)[:3]]
        return [describe_state(self.model.variables, self.layout.unpack(row)) for row in found]

    def rewards(self, reward: Reward) -> Floats:
        """The expected reward of each row; in a CTMC, times the exit rate.

        Raises:
            UnsupportedError: a reward is negative or infinite.
        """
        groups, rows = self.matrix.groups, self.matrix.rows
        states, transitions = np.zeros(self.total), np.zeros(rows)
        match reward:
            case Structure(index):
                items = [i for i in self.model.rewards[index].items if i.on_states]
                if items:
                    code = compile_expression(total_reward(items), self.model)
                    states[: self.own] = code.run_packed(self.layout, self.rows.states)
                transitions = self.rows.rewards[index]
            case Time() if self.continuous_time:
                states[: self.own] = 1.0
            case Steps() | Time():
                transitions = self.matrix.row_sums()
            case _:
                assert_never(reward)
        found = transitions + (states if groups is None else np.repeat(states, np.diff(groups)))
        if not bool(((found >= 0) & np.isfinite(found)).all()):
            raise UnsupportedError(
                "rewards that are negative or infinite are not computed on distributed models",
                hint="check it on one machine",
            )
        return found
