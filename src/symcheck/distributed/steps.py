"""Steps of a part: each gives the values of the next one, for bounds on steps or time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.iteration import Iteration
from symcheck.distributed.messages import Message
from symcheck.kernels.rows import sparse
from symcheck.numerics.tuning import UNIT_ROUNDOFF

__all__ = ["PartSteps"]


class PartSteps:
    """Steps with given values on all states outside of the unknowns.

    Args:
        part: its rows.
        iteration: the values before the first step, and its unknowns.
        rate: of uniformisation; None: the steps of the chain.
    """

    def __init__(self, part: ExploredPart, iteration: Iteration, rate: float | None) -> None:
        self._part, self._iteration, self._rate = part, iteration, rate
        self._states = np.flatnonzero(iteration.unknown_own).astype(np.int32)
        self._values = np.empty(len(self._states))
        self._stay = np.zeros(len(self._states))
        if rate is not None:
            self._stay = 1 - part.matrix.row_sums()[self._states] / rate

    def slack(self) -> float:
        """The relative error of a step by rounding."""
        return 2 * (self._part.matrix.longest + 8) * UNIT_ROUNDOFF

    def step(self, incoming: Sequence[Message], weight: float) -> tuple[list[float], list[Message]]:
        """Add the weighted values of the initial states, and go a step; the sums, and messages."""
        matrix, iteration = self._part.matrix, self._iteration
        x, new = iteration.lower, self._values
        self._part.boundary.receive(x, incoming)
        iteration.sums += weight * x[self._part.rows.initial]
        sparse.best_products(
            *matrix.arrays, matrix.groups, self._states, x, iteration.mode == 2, new
        )
        if self._rate is not None:
            new = new / self._rate + self._stay * x[self._states]
        x[self._states] = new
        return [float(s) for s in iteration.sums], iteration.changes()
