"""Linear programs solved exactly: HiGHS finds an optimal vertex, rational arithmetic proves it.

The positive columns of the vertex, completed to a basis by columns of reduced cost 0, determine the
vertex and the dual solution exactly. Both are optimal if the vertex is not negative and no reduced
cost has the wrong sign.
Sources: Dhiflaoui et al. (2003), 'Certifying and repairing solutions to large LPs'; Applegate,
Cook, Dash & Espinoza (2007), 'Exact solutions to linear programming problems'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Floats, Int64s, starts_of

__all__ = ["ROWS", "Column", "Optimum", "Program", "solve_program"]

ROWS = 1_000
"""Equations up to which programs are solved: rational solutions take cubic time."""
_PRIME = 2**61 - 1
_SMALL = 1e-9
_TRIES = (1e-11, 1e-9, 1e-7)
"""Reduced costs up to which a column may be in the basis, tried in turn."""

_PIVOTS = 50
"""Exact steps of the simplex method from the vertex that floating point gives."""

Column = dict[int, Fraction]


@dataclass(frozen=True, eq=False)
class Program:
    """Maximise cost · x subject to sum of x_j columns[j] = right and x >= 0."""

    columns: Sequence[Column] = field(repr=False)
    cost: Sequence[Fraction] = field(repr=False)
    right: Sequence[Fraction] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The exact optimum (inf: unbounded), and the columns that are not 0 there."""

    value: Fraction | float
    x: dict[int, Fraction]
    iterations: int = 0


def solve_program(program: Program) -> Optimum | None:
    """The exact optimum; None if the program is infeasible.

    Raises:
        NumericalError: the vertex that HiGHS finds could not be proved optimal, or there are more
            than ROWS rows.
    """
    if len(program.right) > ROWS:
        raise NumericalError(
            f"linear programs are solved exactly up to {ROWS:,} equations, and this one has "
            f"{len(program.right):,}"
        )
    status, answer = _float(program)
    if status == 0:
        for threshold in _TRIES:
            found = _proved(program, answer, threshold)
            if found is not None:
                return found
        raise NumericalError(
            "the vertex that the linear program's solver finds could not be proved optimal in "
            "rational arithmetic"
        )
    if status == 2:
        _prove_infeasible(program)
        return None
    if status == 3:
        _prove_unbounded(program)
        return Optimum(inf, {})
    raise NumericalError(f"the linear program was not solved: {answer.message}")


def _float(program: Program) -> tuple[int, Any]:
    from scipy.optimize import linprog
    from scipy.sparse import csc_array

    indptr = starts_of([len(c) for c in program.columns])
    rows = np.array([i for c in program.columns for i in c], dtype=np.int64)
    data = np.array([float(v) for c in program.columns for v in c.values()])
    matrix = csc_array((data, rows, indptr), shape=(len(program.right), len(program.columns)))
    cost, right = (
        np.array([float(v) for v in program.cost]),
        np.array([float(v) for v in program.right]),
    )
    settings = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    answer = linprog(
        -cost, None, None, matrix, right, (0, None), method="highs-ds", options=settings
    )
    if answer.status == 4:
        answer = linprog(
            -cost,
            None,
            None,
            matrix,
            right,
            (0, None),
            method="highs-ds",
            options={"presolve": False},
        )
    return int(answer.status), answer


def _proved(program: Program, answer: Any, threshold: float) -> Optimum | None:
    """The exact vertex and its value if it is feasible and optimal."""
    x: Floats = np.asarray(answer.x)
    reduced: Floats = np.abs(np.asarray(answer.lower.marginals))
    scale = max(1.0, float(np.abs(x).max(initial=0.0)))
    positive = np.flatnonzero(x > _SMALL * scale)
    others = np.flatnonzero(
        (x <= _SMALL * scale) & (reduced <= threshold * max(1.0, float(reduced.max(initial=0.0))))
    )
    candidates = np.concatenate(
        (
            positive[np.argsort(-x[positive], kind="stable")],
            others[np.argsort(reduced[others], kind="stable")],
        )
    )
    basis, rows = _independent(program, candidates)
    if len(basis) != len(rows):
        return None
    for _ in range(_PIVOTS):
        vertex = _Vertex.at(program, basis, rows)
        if vertex is None:
            return None
        if vertex.feasible and vertex.optimal:
            values = dict(zip(basis, vertex.x, strict=True))
            if not _satisfied(program, values):
                return None
            value = sum((program.cost[j] * v for j, v in values.items()), Fraction(0))
            return Optimum(value, {j: v for j, v in values.items() if v}, int(answer.nit))
        pivot = (
            vertex.primal_pivot()
            if vertex.feasible
            else vertex.dual_pivot()
            if vertex.optimal
            else None
        )
        if pivot is None:
            return None
        place, entering = pivot
        basis = [*basis[:place], entering, *basis[place + 1 :]]
    return None


@dataclass(frozen=True, eq=False)
class _Vertex:
    """A basis with its exact solution, and the exact reduced cost (cost - y A) of every column."""

    program: Program
    basis: Sequence[int]
    rows: Sequence[int]
    x: list[Fraction]
    reduced: list[Fraction]

    @classmethod
    def at(cls, program: Program, basis: Sequence[int], rows: Sequence[int]) -> _Vertex | None:
        """None where the basis is singular."""
        x = _solved(
            _basis_matrix(program, basis, rows, transposed=False), [program.right[i] for i in rows]
        )
        y = _solved(
            _basis_matrix(program, basis, rows, transposed=True), [program.cost[j] for j in basis]
        )
        if x is None or y is None:
            return None
        dual = {i: v for i, v in zip(rows, y, strict=True) if v}
        return cls(
            program,
            basis,
            rows,
            x,
            [c - _dot(a, dual) for a, c in zip(program.columns, program.cost, strict=True)],
        )

    @property
    def feasible(self) -> bool:
        """Whether nothing is negative."""
        return all(v >= 0 for v in self.x)

    @property
    def optimal(self) -> bool:
        """Whether no column would gain."""
        return all(v <= 0 for v in self.reduced)

    def primal_pivot(self) -> tuple[int, int] | None:
        """The position of the basis that leaves, and the column that enters (Bland's rule)."""
        entering = next(j for j, v in enumerate(self.reduced) if v > 0)
        column = self.program.columns[entering]
        step = _solved(
            _basis_matrix(self.program, self.basis, self.rows, transposed=False),
            [column.get(i, Fraction(0)) for i in self.rows],
        )
        assert step is not None
        ratios = [
            (x / d, self.basis[k], k)
            for k, (x, d) in enumerate(zip(self.x, step, strict=True))
            if d > 0
        ]
        return (min(ratios)[2], entering) if ratios else None

    def dual_pivot(self) -> tuple[int, int] | None:
        """A negative position of the basis, and the column that keeps the basis optimal there."""
        place = next(k for k, v in enumerate(self.x) if v < 0)
        unit = [Fraction(int(k == place)) for k in range(len(self.basis))]
        weights = _solved(_basis_matrix(self.program, self.basis, self.rows, transposed=True), unit)
        assert weights is not None
        row = {i: v for i, v in zip(self.rows, weights, strict=True) if v}
        taken = set(self.basis)
        ratios = []
        for j, a in enumerate(self.program.columns):
            slope = _dot(a, row) if j not in taken else Fraction(0)
            if slope < 0:
                ratios.append((self.reduced[j] / slope, j))
        return (place, min(ratios)[1]) if ratios else None


def _dot(column: Column, weights: dict[int, Fraction]) -> Fraction:
    return sum((v * weights[i] for i, v in column.items() if i in weights), Fraction(0))


def _independent(program: Program, candidates: Int64s) -> tuple[list[int], list[int]]:
    """The first independent columns, and rows on which they are independent, modulo a prime."""
    import flint

    n = len(program.right)
    matrix = flint.nmod_mat(n, len(candidates), _PRIME)
    for k, j in enumerate(candidates.tolist()):
        for i, v in program.columns[j].items():
            matrix[i, k] = _residue(v)
    reduced, rank = matrix.rref()
    pivots, k = [], 0
    for i in range(rank):
        while int(reduced[i, k]) == 0:
            k += 1
        pivots.append(int(candidates[k]))
    if rank == n:
        return pivots, list(range(n))
    turned = flint.nmod_mat(rank, n, _PRIME)
    for k, j in enumerate(pivots):
        for i, v in program.columns[j].items():
            turned[k, i] = _residue(v)
    reduced, _ = turned.rref()
    rows, i = [], 0
    for k in range(rank):
        while int(reduced[k, i]) == 0:
            i += 1
        rows.append(i)
    return pivots, rows


def _residue(value: Fraction) -> int:
    return value.numerator % _PRIME * pow(value.denominator, -1, _PRIME) % _PRIME


def _basis_matrix(
    program: Program, basis: Sequence[int], rows: Sequence[int], *, transposed: bool
) -> Any:
    import flint

    place = {r: i for i, r in enumerate(rows)}
    matrix = flint.fmpq_mat(len(rows), len(rows))
    for k, j in enumerate(basis):
        for i, v in program.columns[j].items():
            if i in place:
                matrix[(k, place[i]) if transposed else (place[i], k)] = flint.fmpq(
                    v.numerator, v.denominator
                )
    return matrix


def _solved(matrix: Any, right: Sequence[Fraction]) -> list[Fraction] | None:
    import flint

    if not right:
        return []
    vector = flint.fmpq_mat(len(right), 1, [flint.fmpq(v.numerator, v.denominator) for v in right])
    try:
        solution = matrix.solve(vector)
    except ZeroDivisionError:
        return None
    return [Fraction(int(v.p), int(v.q)) for v in solution.entries()]


def _satisfied(program: Program, values: dict[int, Fraction]) -> bool:
    left = [Fraction(0)] * len(program.right)
    for j, x in values.items():
        for i, v in program.columns[j].items():
            left[i] += v * x
    return left == list(program.right)


def _prove_infeasible(program: Program) -> None:
    """Prove that the least violation is not 0. Raises NumericalError otherwise."""
    columns, cost = list(program.columns), [Fraction(0)] * len(program.columns)
    for i, b in enumerate(program.right):
        columns.append({i: Fraction(1 if b >= 0 else -1)})
        cost.append(Fraction(-1))
    found = solve_program(Program(columns, cost, program.right))
    if found is None or not found.value < 0:
        raise NumericalError("a linear program that its solver takes for infeasible is not")


def _prove_unbounded(program: Program) -> None:
    """Find an improving ray and a solution, exactly. Raises NumericalError otherwise."""
    n = len(program.right)
    columns = [{**c, n: Fraction(1)} for c in program.columns] + [{n: Fraction(1)}]
    ray = solve_program(
        Program(columns, [*program.cost, Fraction(0)], [Fraction(0)] * n + [Fraction(1)])
    )
    point = solve_program(
        Program(program.columns, [Fraction(0)] * len(program.columns), program.right)
    )
    if ray is None or not ray.value > 0 or point is None:
        raise NumericalError("a linear program that its solver takes for unbounded is not")
