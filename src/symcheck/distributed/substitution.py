"""Backward substitution on a part: components of states are solved once the values of all states
that they lead to are known.

Sources: Dai, Mausam, Weld & Goldsmith (2011) for the order; `symcheck.numerics.linear.methods.
topological` solves the components.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from symcheck.distributed import tuning
from symcheck.distributed.messages import Boundary, Message
from symcheck.kernels.graph.component_queue import ComponentQueue
from symcheck.kernels.solve.certificates import component_depths
from symcheck.kernels.solve.component_bounds import ComponentSolver
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics import tuning as solver_tuning
from symcheck.numerics.linear.methods.topological import TopologicalRun, solve_in_order
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.settings import Settings

__all__ = ["PartEquations", "Substitution"]


@dataclass(frozen=True, eq=False)
class PartEquations:
    """The equations of a part with m states, ghosts included.

    Attributes:
        matrix, constant, mode, rates: as in `symcheck.numerics.linear.masked_problem`; `mode` is
            the kernels' code for the direction.
        column_ptr, column_rows, row_state: the transposed structure.
    """

    matrix: SparseMatrix
    constant: Floats | None
    mode: int
    rates: bool
    column_ptr: Int64s
    column_rows: Int32s
    row_state: Int32s

    @property
    def probability(self) -> bool:
        """Whether the values are probabilities."""
        return self.constant is None


class Substitution:
    """The unknown states of a part, whose components are solved as values become known.

    Args:
        equations: of the part.
        unknown: bool[m], the states without known values, also those of other parts.
        own: the number of states of this part, which come first.
        values: float64[m, 2], bounds; those of states that become known are written here.
        settings: the accuracy.
        boundary: of the part.
        told: for each other part, the states whose values it knows.
    """

    def __init__(
        self,
        equations: PartEquations,
        unknown: Bools,
        own: int,
        values: Floats,
        settings: Settings,
        boundary: Boundary,
        told: Sequence[Bools],
    ) -> None:
        e, m = equations, equations.matrix
        self.unknown, self.values = unknown, values
        self._own, self._boundary, self._told = own, boundary, told
        inside = unknown.copy()
        inside[own:] = False
        source = graph.Incidence(m)
        parts = graph.sccs(source, inside)
        small = solver_tuning.SMALL_COMPONENT_STATES if e.mode == 0 else 1
        self._order, self._start = parts.order, parts.start
        self._depths = component_depths(
            source.edges, m.indices, parts.of, parts.order, parts.start, small
        )
        self._queue = ComponentQueue(
            e.column_ptr,
            e.column_rows,
            e.row_state,
            parts.of,
            parts.count,
            unknown.view(np.uint8),
            self._in_end_components(e, inside).view(np.uint8),
        )
        system = ComponentSolver(
            *m.arrays, m.groups, e.constant, e.constant, None, e.mode, None, e.rates
        )
        no_strategy = np.empty(0, np.int64)
        self._run = TopologicalRun(
            system, e.probability, True, values, no_strategy, settings, observer=None
        )
        self._share = tuning.SUBSTITUTION_SHARE * settings.epsilon
        self.width = 0.0

    @staticmethod
    def _in_end_components(equations: PartEquations, inside: Bools) -> Bools:
        """The states whose equations have several solutions, the least of which is wanted."""
        if equations.mode == 0 or equations.probability != (equations.mode == 2):
            return np.zeros(len(inside), np.bool_)
        usable = None if equations.constant is None else equations.constant == 0.0
        found = graph.maximal_end_components(equations.matrix, inside, usable)
        # A choice that only leads back to its state is left out where components are solved.
        large = np.bincount(found.of[found.of >= 0], minlength=found.count) > 1
        return np.append(large, False)[found.of]

    def solve_ready(self, incoming: Sequence[Message]) -> list[Message]:
        """Solve the components whose last successors have become known, and tell the others."""
        self._boundary.receive(self.values, incoming)
        self._decide(self._boundary.ghosts(incoming))
        return self._boundary.of_new(~self.unknown, self._told, self.values)

    def known_values(self) -> Floats:
        """The bounds of the states of this part, not a number where they are not known yet."""
        found = self.values[: self._own].copy()
        found[self.unknown[: self._own]] = np.nan
        return found

    def _decide(self, found: Int32s) -> None:
        """Solve the components that have waited for some states of other parts."""
        self.unknown[found] = False
        self._widen(found)
        ready = self._queue.ready(found, self._order, self._start)
        begin, end = self._start[ready], self._start[ready + 1]
        order = self._order[spans(begin, end)]
        # The bounds of successors are some steps of the width apart already.
        before = ceil(self.width / self._share) if self.width < np.inf else 0
        depths = self._depths[ready] + np.int32(min(before, tuning.MAX_SUBSTITUTION_STEPS))
        solve_in_order(self._run, order, starts_of(end - begin), depths, self._share)
        if self._run.probability:
            self.values[order] = self.values[order].clip(0.0, 1.0)
        self.unknown[order] = False
        self._widen(order)

    def _widen(self, states: Int32s) -> None:
        """Record the largest relative width of bounds."""
        low, high = self.values[states].T
        self.width = max(self.width, largest_width(low, high, relative=True))
