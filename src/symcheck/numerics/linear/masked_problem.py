"""Linear problems over some states of a full matrix, whose rows are used in place.

If most states are unknown, a submatrix would take as much memory as the matrix itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.rows import submatrix as kernel
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.tuning import ENTRY_ERROR, UNIT_ROUNDOFF

__all__ = ["MaskedProblem"]


@dataclass(frozen=True, eq=False)
class MaskedProblem:
    """x_s = opt over the rows r of s of (constant[r] + sum over t of A[r, t] x_t), where s is
    unknown.

    matrix: the rows of all states; each sums to 1, or with `rates` (no choices) the equations are
      divided by the sum of the row.
    unknown: bool[states].
    known: pairs of a set of states (bool[states]) and the value there; other states have value 0.
    constant: float64[rows of the matrix]; None is 0.

    LinearProblem describes the other fields and the assumptions.
    """

    matrix: SparseMatrix = field(repr=False)
    unknown: Bools = field(repr=False)
    known: Sequence[tuple[Bools, float]] = field(default=(), repr=False)
    constant: Floats | None = field(default=None, repr=False)
    direction: Direction | None = None
    probability: bool = True
    rates: bool = False
    error: float = ENTRY_ERROR
    constant_error: float = 0.0

    @cached_property
    def n(self) -> int:
        """Number of unknown states."""
        return int(np.count_nonzero(self.unknown))

    @property
    def mode(self) -> int:
        """The kernels' code for the direction: 0 without choices, 1 for min, 2 for max."""
        if self.matrix.groups is None:
            return 0
        return 2 if self.direction == Direction.MAX else 1

    @property
    def signed(self) -> bool:
        """Whether some constant is negative."""
        return self.constant is not None and bool(self.constant.min(initial=0.0) < 0.0)

    def initial_values(self) -> Floats:
        """Lower and upper values, float64[states, 2]: the known ones, and 0 at unknown states."""
        x = np.zeros((self.matrix.states, 2))
        for states, value in self.known:
            x[states] = value
        x[self.unknown] = 0.0
        return x

    def collapsible(self) -> bool:
        """Whether end components must be collapsed, for which the rows must be copied."""
        if self.matrix.groups is None or self.probability != (self.direction == Direction.MAX):
            return False
        usable = None if self.constant is None else self.constant == 0.0
        return graph.maximal_end_components(self.matrix, self.unknown, usable).count > 0

    def extract(self) -> LinearProblem:
        """The equations of the unknown states as a problem with a matrix of its own."""
        m, chosen = self.matrix, self.unknown.view(np.uint8)
        values = self.initial_values()[:, 0].copy()
        outside = (~self.unknown).view(np.uint8)
        constant = kernel.sum_columns(*m.arrays, m.groups, chosen, outside, values)
        leave = kernel.sum_columns(*m.arrays, m.groups, chosen, outside, None)
        if self.constant is not None:
            constant += self.constant[m.rows_of(self.unknown)]
        matrix = m.among(self.unknown)
        if self.rates:
            total = matrix.row_sums() + leave
            matrix = matrix.divided(total)
            constant, leave = constant / total, leave / total
        error = self.error + (m.longest + 2) * UNIT_ROUNDOFF
        return LinearProblem(
            constant,
            matrix,
            None,
            leave,
            self.direction,
            self.probability,
            error=2 * error,
            constant_error=self.constant_error,
        )
