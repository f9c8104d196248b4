"""Least solutions of x = A x + b over the rationals, with strategies where rows are choices.

Optimal strategies are found by policy iteration, which ends after finitely many steps and whose comparisons are exact;
nothing in floating point is relied on. Sources: Howard (1960); Bertsekas & Tsitsiklis (1991) for least expected rewards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.rows import starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.rational import ExactMatrix, ExactProblem, solve_exact

__all__ = ["Entries", "RationalProblem", "exact_matrix", "least_solution"]

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
    direction: Direction | None = None
    start: Sequence[int] | None = field(default=None, repr=False)

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return len(self.groups) - 1


def least_solution(problem: RationalProblem) -> tuple[list[Fraction], int]:
    """The solution, and how many strategies were evaluated. Raises NumericalError where it would not be finite."""
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
            value = problem.constant[r] + sum(
                (p * values[t] for t, p in problem.rows[r]), Fraction(0)
            )
            if value > best if problem.direction == Direction.MAX else value < best:
                best, chosen = value, r
        if chosen >= 0:
            policy[s] = chosen
            changed = True
    return changed


def _evaluate(problem: RationalProblem, policy: Sequence[int]) -> list[Fraction]:
    """The least solution for one strategy: 0 where no constant is ever met, and unique elsewhere."""
    constant = [problem.constant[r] for r in policy]
    rows = [problem.rows[r] for r in policy]
    source = np.array([bool(c) for c in constant], dtype=bool)
    alive = np.flatnonzero(graph.backward_reachable(exact_matrix(rows).rounded(), source)).tolist()
    number = {s: i for i, s in enumerate(alive)}
    inner = exact_matrix([[(number[t], p) for t, p in rows[s] if t in number] for s in alive])
    values = [Fraction(0)] * problem.n
    for s, value in zip(
        alive, solve_exact(ExactProblem(inner, [constant[s] for s in alive])).values, strict=True
    ):
        values[s] = value
    return values


def exact_matrix(rows: Sequence[Entries]) -> ExactMatrix:
    """Rows of a square matrix, one per state."""
    table = sorted({p for row in rows for _, p in row})
    code = {p: i for i, p in enumerate(table)}
    return ExactMatrix(
        starts_of([len(row) for row in rows]),
        np.array([t for row in rows for t, _ in row], dtype=np.int32),
        np.array([code[p] for row in rows for _, p in row], dtype=np.int32),
        table,
        len(rows),
    )
