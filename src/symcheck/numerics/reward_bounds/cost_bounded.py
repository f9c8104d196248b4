"""Rewards that are earned while a cost stays within a budget, one budget after the other.

A step is counted if its cost is within what is left of the budget; the first step beyond it ends
the run. So the value for a budget depends on those for smaller ones, by rows with a cost, and on
itself, by rows without. The latter are linear equations of their own at each level.

Source: Hartmanns, Junges, Katoen & Quatmann (2018), Multi-cost bounded reachability in MDP.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import MemoryLimitError, UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix, best_of_rows, spans, starts_of
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress
from symcheck.numerics.settings import Accuracy, Settings
from symcheck.numerics.tuning import ENTRY_ERROR
from symcheck.numerics.underflow import enclosed, may_underflow

__all__ = ["CostBoundedProblem", "solve_cost_bounded"]


@dataclass(frozen=True, eq=False)
class CostBoundedProblem:
    """Expected reward of the steps whose total cost is at most `budget`.

    matrix: probabilities among n states, rows that sum to 1. rewards: what a step by the row earns
    on average, not negative. costs: whole numbers, int64[rows]. direction: None without choices.
    error: of the probabilities, relative.
    """

    matrix: SparseMatrix
    rewards: Numbers = field(repr=False)
    costs: Int64s = field(repr=False)
    budget: int
    direction: Direction | None
    error: float = ENTRY_ERROR

    @property
    def groups(self) -> Int64s:
        """Rows of each state: int64[n+1]."""
        groups = self.matrix.groups
        return np.arange(self.matrix.rows + 1, dtype=np.int64) if groups is None else groups

    def best(self, rows: Numbers) -> Numbers:
        """The optimum over the rows of each state."""
        return best_of_rows(rows, self.matrix.groups, self.direction)


def solve_cost_bounded(
    problem: CostBoundedProblem, settings: Settings, observer: Observer | None = None
) -> tuple[Numbers, Numbers, int]:
    """Bounds on the rewards of all states for the whole budget, and the number of levels.

    Infinite where a cycle without cost that earns a reward cannot be avoided ('max': is reached).
    Bounds leave out the rounding of products, relatively a few units per level.

    Raises:
        MemoryLimitError: the levels that are kept at a time do not fit into EPOCH_BYTES.
        UnsupportedError: a least reward is infinite.
    """
    m, n, exact = problem.matrix, problem.matrix.states, problem.matrix.is_rational
    within = (problem.costs > 0) & (problem.costs <= problem.budget)
    slots = int(problem.costs[within].max(initial=0)) + 1
    if slots * n * 16 > tuning.EPOCH_BYTES:
        raise MemoryLimitError(
            f"costs of up to {slots - 1} steps of the budget over {n:,} states need more than 4 GB "
            "of memory"
        )
    by_cost = [
        (int(c), rows, m.choose(rows.astype(np.int64)))
        for c in np.unique(problem.costs[within])
        for rows in (np.flatnonzero(problem.costs == c),)
    ]
    free = _FreeSteps(problem) if (problem.costs == 0).any() else None
    rows_of_free = np.flatnonzero(problem.costs == 0)
    least = 1.0 if exact else float(m.data.min(initial=np.inf, where=m.data > 0))
    ring: list[tuple[Numbers, Numbers]] = []
    level, same = 0, 0
    finer = Accuracy(
        method=settings.method,
        epsilon=max(1e-15, settings.epsilon / (4 * problem.budget + 4)),
        relative=settings.relative,
        certify=settings.certify,
        max_iterations=settings.max_iterations,
    )
    for level in range(problem.budget + 1):
        constant = full(m.rows, 0, rational=exact)
        constant[rows_of_free] = problem.rewards[rows_of_free]
        upper = constant.copy()
        for cost, rows, part in by_cost:
            if cost <= level:
                low, high = ring[-cost]
                rewards = problem.rewards[rows]
                bounds = [rewards + part.multiply(low), rewards + part.multiply(high)]
                if may_underflow(low, least) or may_underflow(high, least):
                    bounds = enclosed(bounds, partial(part.multiply, (high != 0) * 1.0))
                constant[rows], upper[rows] = bounds
        if free is None:
            values = problem.best(constant), problem.best(upper)
        else:
            values = free.solve(constant, upper, finer)
        unchanged = bool(ring) and all(map(np.array_equal, ring[-1], values))
        same = same + 1 if unchanged else 0
        ring = [*ring[-slots + 1 :], values] if slots > 1 else [values]
        if observer is not None:
            observer(Progress("budget by budget", level + 1, 0.0, n))
        if same > slots:
            break  # all levels that matter are equal, and so are all that follow
    return *ring[-1], level + 1


class _FreeSteps:
    """The equations of a level: rows without cost, and a sink to which the others lead."""

    def __init__(self, problem: CostBoundedProblem) -> None:
        self.problem = problem
        m, n = problem.matrix, problem.matrix.states
        free = problem.costs == 0
        lengths = np.where(free, m.lengths, 1)
        starts = starts_of(np.append(lengths, 1))
        indices = np.full(starts[-1], n, np.int32)
        data = full(int(starts[-1]), 1, rational=m.is_rational)
        kept, old = np.repeat(free, m.lengths), spans(starts[:-2][free], starts[1:-1][free])
        indices[old], data[old] = m.indices[kept], m.data[kept]
        groups = np.append(problem.groups, m.rows + 1)
        self.closed = SparseMatrix(starts, indices, data, n + 1, groups)
        self.source = graph.Incidence(self.closed)
        self.free = np.append(free, False)
        self.owner = np.repeat(np.arange(n + 1), np.diff(groups))
        self.earning = np.append(problem.rewards > 0, False)
        self.states = np.arange(n + 1) < n
        self._known: Bools | None = None
        self._part: tuple[SparseMatrix, Numbers] | None = None
        self._is_least = problem.direction is Direction.MIN
        if self._is_least:
            self._require_finite()

    def _members(self, rows: Bools) -> Bools:
        """The states of some rows."""
        out = np.zeros(len(self.states), np.bool_)
        out[self.owner[rows]] = True
        return out

    @cached_property
    def nothing(self) -> Bools:
        """States of value 0 at every level, beside the sink."""
        if self._is_least:  # a strategy may stay where nothing is earned
            rows = self.free & ~self.earning
            return graph.maximal_end_components(self.source, self.states, rows).of >= 0
        paying = self._members((self.earning | ~self.free) & self.states[self.owner])
        return self.states & ~graph.backward_reachable(self.source, paying)

    @cached_property
    def forever(self) -> Bools:
        """States in an end component without cost that earns a reward."""
        parts = graph.maximal_end_components(self.source, self.states, self.free)
        paying = np.zeros(parts.count, np.bool_)
        paying[parts.of[self.owner[parts.rows & self.earning]]] = True
        inside = parts.of >= 0
        inside[inside] = paying[parts.of[inside]]
        return inside

    def _require_finite(self) -> None:
        target = self.nothing | ~self.states
        if not graph.prob1(self.source, np.ones_like(target), target, Direction.MAX).all():
            raise UnsupportedError(
                "a least reward that is infinite, because cycles without cost earn a reward and "
                "cannot be left, is not supported"
            )

    def solve(
        self, constant: Numbers, upper: Numbers, settings: Settings
    ) -> tuple[Numbers, Numbers]:
        """Bounds on the values of a level, given those of the rows with a cost."""
        n, exact = self.problem.matrix.states, self.closed.is_rational
        infinite = self._reaching(constant, None if self._is_least else self.forever)
        unbounded = self._reaching(upper)  # infinite, or no upper bound is proved
        unknown = self.states & ~(self.nothing | infinite)
        low = full(n + 1, 0, rational=exact)
        low[infinite] = np.inf
        high = low.copy()
        if unknown.any():
            finite = np.where(is_infinite(upper), constant, upper)
            low[unknown], high[unknown] = self._solved(unknown, constant, finite, settings)
        high[unbounded] = np.inf
        return low[:n], high[:n]

    def _reaching(self, rows: Numbers, states: Bools | None = None) -> Bools:
        """The states from which a row with an infinite number, or one of some states, is reached
        without cost.
        """
        target = self._members(np.append(is_infinite(rows), False))
        if states is not None:
            target |= states
        return graph.backward_reachable(self.source, target) if target.any() else target

    def _solved(
        self, unknown: Bools, constant: Numbers, upper: Numbers, settings: Settings
    ) -> tuple[Numbers, Numbers]:
        from symcheck.numerics.linear.methods import solve_linear

        direction = self.problem.direction
        if self._known is None or not np.array_equal(self._known, unknown):
            part = self.closed.among(unknown)
            if direction is None:
                part = replace(part, groups=None)
            self._known, self._part = unknown, (part, self.closed.sums(unknown, ~unknown))
        assert self._part is not None
        part, leave = self._part
        rows = self.closed.rows_of(unknown)[:-1]
        problem = LinearProblem(
            constant[rows],
            part,
            None if np.array_equal(constant, upper) else upper[rows],
            leave,
            direction,
            probability=False,
            error=self.problem.error,
        )
        quotient = None
        if direction is Direction.MAX:
            # Staying where nothing is earned is never better than leaving.
            quotient = collapse(replace(problem, direction=Direction.MIN))
        if quotient is None:
            solution = solve_linear(problem, settings)
        else:
            inner = replace(quotient.problem, direction=direction)
            solution = quotient.expand(solve_linear(inner, settings))
        return solution.lower, solution.upper
