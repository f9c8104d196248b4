"""Least solutions of x = A x + b over the rationals, from rows as lists of entries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import SparseMatrix, starts_of
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.settings import Accuracy

__all__ = ["Entries", "RationalProblem", "exact_matrix", "least_solution"]

Entries = list[tuple[int, Fraction]]


@dataclass(frozen=True)
class RationalProblem:
    """x_s = opt over the rows r of s of (constant[r] + sum of A[r, t] x_t): the least non-negative solution is wanted.

    rows: per row, its entries among the n unknowns. State s has the rows `groups[s]` to `groups[s+1]`. The solution must
    be finite under every strategy that is met. reward: the least solution is taken over strategies that leave almost surely.
    """

    rows: Sequence[Entries] = field(repr=False)
    constant: Sequence[Fraction] = field(repr=False)
    groups: Sequence[int] = field(repr=False)
    direction: Direction | None = None
    reward: bool = False


def least_solution(problem: RationalProblem) -> tuple[list[Fraction], int]:
    """The solution, and how many strategies were evaluated. Raises NumericalError where it would not be finite."""
    matrix = exact_matrix(
        problem.rows, None if problem.direction is None else np.array(problem.groups, np.int64)
    )
    constant = rationals(problem.constant)
    found = solve_linear(
        LinearProblem(
            constant, matrix, direction=problem.direction, probability=not problem.reward
        ),
        Accuracy(),
    )
    return found.lower.tolist(), found.iterations


def exact_matrix(rows: Sequence[Entries], groups: np.ndarray | None = None) -> SparseMatrix:
    """Rows of a square matrix, one per state unless there are groups."""
    return SparseMatrix(
        starts_of([len(row) for row in rows]),
        np.array([t for row in rows for t, _ in row], dtype=np.int32),
        rationals(p for row in rows for _, p in row),
        len(rows) if groups is None else len(groups) - 1,
        groups,
    )
