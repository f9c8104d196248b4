"""End components made into single states, so that the equations of an MDP have one solution.

For the greatest probability, all states of an end component have the same value: that of the best way out. For the least
reward, the same holds for end components without reward, where a strategy could otherwise wait for ever, for free.
Sources: Haddad & Monmege (2018); Baier, Klein, Leuschner, Parker & Wunderlich (2017).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Solution

__all__ = ["Collapsed", "collapse"]


@dataclass(frozen=True, eq=False)
class Collapsed:
    """A problem whose end components are single states: `place` (int32[n]) gives a state's place, `kept` the rows kept."""

    problem: LinearProblem
    original: LinearProblem
    place: Int32s
    kept: Int64s
    inside: Bools
    components: int

    def expand(self, solution: Solution) -> Solution:
        """The solution of the original problem, with a strategy that walks to the best way out."""
        strategy = None if solution.strategy is None else self._strategy(solution.strategy)
        note = f"{solution.explanation}; {self.components} end component{'s' * (self.components != 1)} collapsed"
        return replace(
            solution,
            lower=solution.lower[self.place],
            upper=solution.upper[self.place],
            strategy=strategy,
            explanation=note,
        )

    def _strategy(self, chosen: Int64s) -> Int64s:
        """Rows of the original states: the chosen one at its owner, and inside rows towards it elsewhere."""
        matrix = self.original.rows
        assert matrix.groups is not None
        n = matrix.states
        rows = np.full(n, -1, dtype=np.int64)
        best = np.where(chosen >= 0, self.kept[np.maximum(chosen, 0)], -1)
        owner = np.repeat(np.arange(n), np.diff(matrix.groups))
        exits = np.zeros(n, dtype=np.bool_)
        used = best[best >= 0]
        rows[owner[used]] = used
        exits[owner[used]] = True
        # Inside an end component, walk towards its exit with the inside rows only.
        inner = _only_rows(matrix, self.inside)
        _, towards = graph.prob1e_strategy(inner.matrix, np.ones(n, dtype=np.bool_), exits)
        walk = (~exits) & (towards >= 0)
        rows[walk] = inner.rows[towards[walk]]
        return rows


@dataclass(frozen=True, eq=False)
class _Rows:
    matrix: SparseMatrix
    rows: Int64s


def _only_rows(matrix: SparseMatrix, keep: Bools) -> _Rows:
    """The same states with the rows of `keep` only."""
    assert matrix.groups is not None
    rows = np.flatnonzero(keep).astype(np.int64)
    return _Rows(matrix.choose(rows, starts_of(keep)[matrix.groups]), rows)


def collapse(problem: LinearProblem) -> Collapsed | None:
    """The quotient, or None where there is nothing to collapse (or no need to)."""
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


def _quotient(problem: LinearProblem, parts: graph.EndComponents, owner: Int32s) -> Collapsed:
    """States by first member; rows that stay inside a component are dropped."""
    matrix = problem.rows
    n = matrix.states
    first = np.arange(n)
    inside = parts.of >= 0
    leader = np.full(parts.count, n, dtype=np.int64)
    np.minimum.at(leader, parts.of[inside], np.flatnonzero(inside))
    first[inside] = leader[parts.of[inside]]
    leads = first == np.arange(n)
    place = (np.cumsum(leads) - 1)[first].astype(np.int32)
    count = int(leads.sum())
    rows = np.flatnonzero(~parts.rows)
    # Rows sorted by the state that they now belong to; the order of rows within a state stays.
    rows = rows[np.argsort(place[owner[rows]], kind="stable")].astype(np.int64)
    groups = starts_of(np.bincount(place[owner[rows]], minlength=count))
    smaller = LinearProblem(
        constant=problem.constant[rows],
        upper=None if problem.upper is None else problem.upper[rows],
        exit=problem.leaving[rows],
        matrix=matrix.choose(rows, groups).merge(place, count),
        direction=problem.direction,
        probability=problem.probability,
    )
    return Collapsed(smaller, problem, place, rows, parts.rows, parts.count)


def unit(values: Floats) -> Floats:
    """Probabilities cut to [0, 1]."""
    return np.clip(values, 0.0, 1.0)
