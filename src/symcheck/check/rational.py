"""Linear equations over the rationals: x = A x + b, with strategies where rows are choices.

Strong components are solved one after the other, successors first; single states directly, larger ones by python-flint's
exact solver. Optimal strategies are found by policy iteration, which ends after finitely many steps and whose comparisons
are exact. Sources: Howard (1960); Bertsekas & Tsitsiklis (1991) for least expected rewards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symcheck.numerics import graph
from symcheck.numerics.matrix import Int64s, SparseMatrix

__all__ = ["RationalProblem", "least_solution", "stationary"]

Entries = list[tuple[int, Fraction]]


@dataclass(frozen=True)
class RationalProblem:
    """x_s = opt over the rows r of s of (constant[r] + sum of A[r, t] x_t): the least non-negative solution is wanted.

    rows: per row, its entries among the n unknowns. owner rows: `groups[s]` to `groups[s+1]`. The solution must be finite
    under every strategy that is met: for 'min' and rewards, `start` (a row per state) must be a strategy that leaves the
    unknowns almost surely.
    """

    rows: Sequence[Entries] = field(repr=False)
    constant: Sequence[Fraction] = field(repr=False)
    groups: Sequence[int] = field(repr=False)
    direction: str | None = None
    start: Sequence[int] | None = field(default=None, repr=False)

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return len(self.groups) - 1


def least_solution(problem: RationalProblem) -> tuple[list[Fraction], int]:
    """The solution, and how many strategies were evaluated. Raises ZeroDivisionError where it would not be finite."""
    policy = list(problem.groups[:-1]) if problem.start is None else list(problem.start)
    evaluated = 0
    while True:
        values = _evaluate(problem, policy)
        evaluated += 1
        if problem.direction is None or not _improve(problem, policy, values):
            return values, evaluated


def _improve(problem: RationalProblem, policy: list[int], values: list[Fraction]) -> bool:
    """Take strictly better rows where there are some; whether any was."""
    changed = False
    for s in range(problem.n):
        best, chosen = values[s], -1
        for r in range(problem.groups[s], problem.groups[s + 1]):
            value = problem.constant[r] + sum((p * values[t] for t, p in problem.rows[r]), Fraction(0))
            if value > best if problem.direction == "max" else value < best:
                best, chosen = value, r
        if chosen >= 0:
            policy[s] = chosen
            changed = True
    return changed


def _evaluate(problem: RationalProblem, policy: Sequence[int]) -> list[Fraction]:
    """The least solution for one strategy: 0 where no constant is ever met, and unique elsewhere."""
    n = problem.n
    rows = [problem.rows[r] for r in policy]
    constant = [problem.constant[r] for r in policy]
    shape = _shape(rows, n)
    source = graph.Incidence(shape)
    alive = graph.backward_reachable(source, np.array([bool(c) for c in constant], dtype=bool))
    values = [Fraction(0)] * n
    parts = graph.sccs(source, alive)
    for c in range(parts.count):
        _solve_component(parts.members(c).tolist(), rows, constant, values)
    return values


def _shape(rows: Sequence[Entries], columns: int) -> SparseMatrix:
    indptr: Int64s = np.concatenate(([0], np.cumsum([len(r) for r in rows]))).astype(np.int64)
    indices = np.array([t for r in rows for t, _ in r], dtype=np.int32)
    return SparseMatrix(indptr, indices, np.ones(len(indices)), columns)


def _solve_component(members: list[int], rows: Sequence[Entries], constant: Sequence[Fraction], values: list[Fraction]) -> None:
    """Fill in the values of a component, those of its successors being known."""
    place = {s: i for i, s in enumerate(members)}
    known = [constant[s] + sum((p * values[t] for t, p in rows[s] if t not in place), Fraction(0)) for s in members]
    if len(members) == 1:
        loop = sum((p for t, p in rows[members[0]] if t in place), Fraction(0))
        values[members[0]] = known[0] / (1 - loop)
        return
    matrix = [[Fraction(0)] * len(members) for _ in members]
    for i, s in enumerate(members):
        matrix[i][i] += 1
        for t, p in rows[s]:
            if t in place:
                matrix[i][place[t]] -= p
    for s, value in zip(members, _solve_dense(matrix, known), strict=True):
        values[s] = value


def _solve_dense(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """A square system by python-flint. Raises ZeroDivisionError where it is singular."""
    import flint

    n = len(right)
    a = flint.fmpq_mat(n, n, [flint.fmpq(v.numerator, v.denominator) for row in matrix for v in row])
    b = flint.fmpq_mat(n, 1, [flint.fmpq(v.numerator, v.denominator) for v in right])
    x = a.solve(b)
    return [Fraction(int(x[i, 0].p), int(x[i, 0].q)) for i in range(n)]


def stationary(rows: Sequence[Entries]) -> list[Fraction]:
    """The stationary distribution of an irreducible chain, from its probabilities or rates (self-loops do not matter)."""
    n = len(rows)
    if n == 1:
        return [Fraction(1)]
    matrix = [[Fraction(0)] * n for _ in range(n)]
    for s, row in enumerate(rows):
        for t, p in row:
            matrix[t][s] += p
            matrix[s][s] -= p
    # One balance equation follows from the others; the sum of all probabilities takes its place.
    matrix[-1] = [Fraction(1)] * n
    return _solve_dense(matrix, [Fraction(0)] * (n - 1) + [Fraction(1)])
