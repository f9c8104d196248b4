"""An engine over the rows of a matrix that an algorithm makes: its states have no variables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import States
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix
from symcheck.semantics.model import BoundModel, BoundRewards
from symcheck.syntax.ast import Expression

__all__ = ["engine_of_rows"]


@dataclass(frozen=True, eq=False)
class _GivenRows:
    """A matrix with one reward structure, as an explored model."""

    model: BoundModel = field(repr=False)
    matrix: SparseMatrix
    state_rewards: Sequence[Numbers]
    choice_rewards: Sequence[Numbers]

    @property
    def choice_actions(self) -> Int32s:
        """No action is known."""
        return np.full(self.matrix.rows, -1, np.int32)

    @property
    def initial(self) -> Int64s:
        """None: values are asked for where they are relevant."""
        return np.zeros(0, np.int64)

    @property
    def deadlocks(self) -> Int64s:
        """None."""
        return np.zeros(0, np.int64)

    @property
    def states(self) -> States:
        """There are no variables."""
        raise UnsupportedError("these states have no variables")

    def evaluate(self, _: Expression) -> Numbers:
        """There are no variables."""
        raise UnsupportedError("these states have no variables")


def engine_of_rows(
    base: ExplicitEngine,
    matrix: SparseMatrix,
    earned: Numbers | None = None,
    *,
    name: str,
    number_error: float,
) -> ExplicitEngine:
    """An engine over the rows of a matrix, with the rewards of rows as its one reward structure.

    Args:
        base: the engine of the model.
        matrix: the rows.
        earned: the reward of each row; None: 0.
        name: of the engine.
        number_error: the relative error of sums of entries of a row.
    """
    rational = matrix.is_rational
    states = full(matrix.states, 0, rational=rational)
    rows = full(matrix.rows, 0, rational=rational) if earned is None else earned
    model = replace(base.model, rewards=(BoundRewards(None, ()),))
    given = _GivenRows(model, matrix, [states], [rows])
    return ExplicitEngine(given, name, number_error=number_error)
