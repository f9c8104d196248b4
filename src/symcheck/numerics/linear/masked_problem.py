"""A linear problem over some states of a matrix that has rows for all: these stay where they are, and nothing is copied.

Where most states are unknown, the rows of the unknowns alone, and what leaves them, would take as much memory as the matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.rows import sparse
from symcheck.kernels.rows import submatrix as kernel
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem

__all__ = ["Embedded"]


@dataclass(frozen=True, eq=False)
class Embedded:
    """x_s = opt over the rows r of s of (constant[r] + sum over t of A[r, t] x_t) at the unknowns; elsewhere x is known.

    matrix: rows of all states, which sum to 1; with `rates` (no choices), the equations are divided by the sum of their row.
    unknown: bool[states]. known: sets of states (bool[states]) and the value there; it is 0 where neither says anything.
    constant: per row of the matrix, None where it is 0. Other fields, and what must hold of the unknowns: see LinearProblem.
    """

    matrix: SparseMatrix = field(repr=False)
    unknown: Bools = field(repr=False)
    known: Sequence[tuple[Bools, float]] = field(default=(), repr=False)
    constant: Floats | None = field(default=None, repr=False)
    direction: Direction | None = None
    probability: bool = True
    rates: bool = False

    @cached_property
    def n(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self.unknown))

    @property
    def mode(self) -> int:
        """0 without choices, 1 for min, 2 for max (as the kernels say it)."""
        if self.matrix.groups is None:
            return 0
        return 2 if self.direction == Direction.MAX else 1

    @property
    def signed(self) -> bool:
        """True where some constant is negative."""
        return self.constant is not None and bool(self.constant.min(initial=0.0) < 0.0)

    def start(self) -> Floats:
        """Lower and upper values of all states, float64[states, 2]: those that are known, 0 at the unknowns."""
        x = np.zeros((self.matrix.states, 2))
        for states, value in self.known:
            x[states] = value
        x[self.unknown] = 0.0
        return x

    def collapsible(self) -> bool:
        """Whether there are end components that must be made single states, for which the rows must be copied."""
        if self.matrix.groups is None or self.probability != (self.direction == Direction.MAX):
            return False
        usable = None if self.constant is None else self.constant == 0.0
        return graph.maximal_end_components(self.matrix, self.unknown, usable).count > 0

    def alone(self) -> LinearProblem:
        """The equations of the unknowns by themselves."""
        m, chosen = self.matrix, self.unknown.view(np.uint8)
        values = self.start()[:, 0].copy()
        outside = (~self.unknown).view(np.uint8)
        constant = kernel.sum_columns(
            m.indptr, m.indices, m.data, m.groups, chosen, outside, values
        )
        leave = kernel.sum_columns(m.indptr, m.indices, m.data, m.groups, chosen, outside, None)
        if self.constant is not None:
            constant += (
                self.constant[self.unknown]
                if m.groups is None
                else kernel.take_rows(self.constant, m.groups, chosen)
            )
        groups = None if m.groups is None else kernel.select_groups(m.groups, chosen)
        matrix = SparseMatrix(
            *kernel.select_states(m.indptr, m.indices, m.data, m.groups, chosen), self.n, groups
        )
        if self.rates:
            total = sparse.row_sums(matrix.indptr, matrix.data) + leave
            matrix = SparseMatrix(
                matrix.indptr,
                matrix.indices,
                matrix.data / np.repeat(total, np.diff(matrix.indptr)),
                self.n,
            )
            constant, leave = constant / total, leave / total
        return LinearProblem(constant, matrix, None, leave, self.direction, self.probability)
