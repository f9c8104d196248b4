"""Quotients of MDPs by end components, on which the equations have a unique solution.

For maximal probabilities, all states of an end component have the same value: that of the best row
that leaves it. For minimal rewards, the same holds for end components without reward, in which a
strategy could otherwise stay forever at no cost.

Sources: Haddad & Monmege (2018); Baier, Klein, Leuschner, Parker & Wunderlich (2017).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.direction import Direction
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Solution
from symcheck.numerics.tuning import UNIT_ROUNDOFF

__all__ = ["MecQuotient", "collapse"]


@dataclass(frozen=True, eq=False)
class MecQuotient:
    """A problem whose end components are single states.

    original: the problem with all states. index: the quotient state of each state, int32[n].
    kept: the original row of each row, int64[rows]. inner_rows: bool[original rows], the rows that
    stay inside an end component. components: the number of end components.
    """

    problem: LinearProblem
    original: LinearProblem
    index: Int32s
    kept: Int64s
    inner_rows: Bools
    components: int

    def expand(self, solution: Solution) -> Solution:
        """The solution of the original problem, with a strategy that moves to the best exit."""
        strategy = None if solution.strategy is None else self._strategy(solution.strategy)
        plural = "s" if self.components != 1 else ""
        note = f"{solution.explanation}; {self.components} end component{plural} collapsed"
        return replace(
            solution,
            lower=solution.lower[self.index],
            upper=solution.upper[self.index],
            strategy=strategy,
            explanation=note,
        )

    def _strategy(self, chosen: Int64s) -> Int64s:
        """Original rows: the chosen one at its state, elsewhere inner rows towards that state."""
        matrix = self.original.rows
        assert matrix.groups is not None
        n = matrix.states
        rows = np.full(n, -1, dtype=np.int64)
        best = np.where(chosen >= 0, self.kept[np.maximum(chosen, 0)], -1)
        owner = matrix.state_of_row
        exits = np.zeros(n, dtype=np.bool_)
        used = best[best >= 0]
        rows[owner[used]] = used
        exits[owner[used]] = True
        # Inside an end component, move towards the exit by inner rows only.
        inner = _only_rows(matrix, self.inner_rows)
        _, towards = graph.prob1e_strategy(inner.matrix, np.ones(n, dtype=np.bool_), exits)
        walk = (~exits) & (towards >= 0)
        rows[walk] = inner.rows[towards[walk]]
        return rows


@dataclass(frozen=True, eq=False)
class _Rows:
    """A matrix and the original row of each of its rows."""

    matrix: SparseMatrix
    rows: Int64s


def _only_rows(matrix: SparseMatrix, keep: Bools) -> _Rows:
    """The matrix with the rows of `keep` only."""
    assert matrix.groups is not None
    rows = np.flatnonzero(keep).astype(np.int64)
    return _Rows(matrix.choose(rows, starts_of(keep)[matrix.groups]), rows)


def collapse(problem: LinearProblem) -> MecQuotient | None:
    """The quotient by the end components; None if there are none, or they do no harm."""
    matrix = problem.rows
    needed = matrix.groups is not None and problem.probability == (
        problem.direction == Direction.MAX
    )
    if not needed:
        return None
    free = (problem.leaving <= 0.0) & (problem.high == 0.0)
    if not free.any():
        return None
    source = graph.Incidence(matrix)
    parts = graph.maximal_end_components(source, np.ones(matrix.states, dtype=np.bool_), free)
    return None if parts.count == 0 else _quotient(problem, parts, source.owner)


def _quotient(problem: LinearProblem, parts: graph.EndComponents, owner: Int32s) -> MecQuotient:
    """The quotient, with states in the order of their first members and without inner rows."""
    matrix = problem.rows
    index, count = parts.quotient_states()
    rows = np.flatnonzero(~parts.rows)
    # Rows are sorted by quotient state; rows of the same state keep their order.
    rows = rows[np.argsort(index[owner[rows]], kind="stable")].astype(np.int64)
    groups = starts_of(np.bincount(index[owner[rows]], minlength=count))
    smaller = LinearProblem(
        constant=problem.constant[rows],
        upper=None if problem.upper is None else problem.upper[rows],
        exit=problem.leaving[rows],
        matrix=matrix.choose(rows, groups).merge(index, count),
        direction=problem.direction,
        probability=problem.probability,
        constant_error=problem.constant_error,
        error=problem.error + matrix.longest * UNIT_ROUNDOFF,
    )
    return MecQuotient(smaller, problem, index, rows, parts.rows, parts.count)
