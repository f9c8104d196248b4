"""Linear programs: HiGHS finds an optimal vertex, and rational arithmetic proves it.

The positive columns of the vertex, completed to a basis by columns of reduced cost 0, determine the
vertex and the dual solution exactly. Both are optimal if the vertex is not negative and no reduced
cost has the wrong sign. Otherwise a few exact steps of the simplex method lead to such a vertex.
Sources: Dhiflaoui et al. (2003), 'Certifying and repairing solutions to large LPs'; Applegate,
Cook, Dash & Espinoza (2007), 'Exact solutions to linear programming problems'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from symcheck.errors import NumericalError
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.numbers import Numbers, doubles, full, is_rational
from symcheck.matrices.rows import Floats, Int64s
from symcheck.numerics.linear.rational import Number, Row, flint_number, fractions
from symcheck.time_limit import seconds_left

if TYPE_CHECKING:
    from flint import fmpq_mat
    from scipy.optimize import OptimizeResult

__all__ = ["ROWS", "Optimum", "Program", "solve_program"]

ROWS = 1_000
"""Equations up to which programs are solved exactly: rational solutions take cubic time."""
_PRIME = 2**61 - 1
_SMALL = 1e-9
_TRIES = (1e-11, 1e-9, 1e-7)
"""Reduced costs up to which a column may be in the basis, tried in turn."""
_PIVOTS = 50
"""Exact steps of the simplex method from the vertex that floating point gives."""
_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
_SETTINGS = (_TOLERANCES, {**_TOLERANCES, "presolve": False}, {"presolve": False})
"""Settings of HiGHS; others than the first are used if a program seems to have no optimum: beside
tiny probabilities, presolve takes programs for infeasible or unbounded that are not."""
_TIME_SLACK = 0.1
"""Seconds after a time limit at which HiGHS stops: the limit is reported by who keeps it."""


@dataclass(frozen=True, eq=False)
class Program:
    """Maximise cost · x subject to A x = right and x >= 0: doubles, or all of them rationals.

    rows, columns, values: the entries of A; those at the same place are added.
    """

    rows: Int64s = field(repr=False)
    columns: Int64s = field(repr=False)
    values: Numbers = field(repr=False)
    right: Numbers = field(repr=False)
    cost: Numbers = field(repr=False)

    @property
    def is_rational(self) -> bool:
        """Whether the numbers are rationals."""
        return is_rational(self.cost)

    def extended(
        self, rows: Int64s, columns: Int64s, values: Numbers, right: Numbers, cost: Numbers
    ) -> Program:
        """The program with more entries, another right-hand side and another cost."""
        return Program(
            np.concatenate((self.rows, rows)),
            np.concatenate((self.columns, columns)),
            np.concatenate((self.values, values)),
            right,
            cost,
        )

    @cached_property
    def exact_columns(self) -> list[Row[Number]]:
        """The columns of A over the rationals."""
        columns: list[Row[Number]] = [{} for _ in self.cost]
        entries = zip(self.rows.tolist(), self.columns.tolist(), self.values, strict=True)
        for i, j, value in entries:
            columns[j][i] = columns[j].get(i, 0) + flint_number(value)
        return columns


@dataclass(frozen=True, eq=False)
class Optimum:
    """The optimum (inf: unbounded), where it is attained, and the gap to the dual bound."""

    value: float | Fraction
    x: Numbers | None = None
    gap: float = 0.0


def solve_program(program: Program) -> Optimum | None:
    """The optimum, which is exact for rationals; None if the program is infeasible.

    Raises:
        NumericalError: HiGHS does not solve the program, the vertex that it finds could not be
            proved optimal, or there are more than ROWS rows.
    """
    if program.is_rational and len(program.right) > ROWS:
        raise NumericalError(
            f"linear programs are solved exactly up to {ROWS:,} equations, and this one has "
            f"{len(program.right):,}"
        )
    answer = _by_highs(program)
    match answer.status:
        case 0:
            return _proved(program, answer) if program.is_rational else _estimated(program, answer)
        case 2:
            if program.is_rational:
                _prove_infeasible(program)
            return None
        case 3:
            if program.is_rational:
                _prove_unbounded(program)
            return Optimum(inf)
        case _:
            raise NumericalError(f"the linear program was not solved: {answer.message}")


def _by_highs(program: Program) -> OptimizeResult:
    """The answer of HiGHS, which minimises."""
    require_memory_for_scipy()
    from scipy.optimize import linprog
    from scipy.sparse import csc_array

    cost, right = -doubles(program.cost), doubles(program.right)
    entries = (doubles(program.values), (program.rows, program.columns))
    matrix = csc_array(entries, shape=(len(right), len(cost)))
    left = seconds_left()
    limit = {} if left is None else {"time_limit": left + _TIME_SLACK}
    statuses: list[int] = []
    for settings in _SETTINGS:
        options = {**settings, **limit}
        answer = linprog(cost, A_eq=matrix, b_eq=right, method="highs-ds", options=options)
        if answer.status not in (2, 3, 4) or (answer.status != 4 and answer.status in statuses):
            break
        statuses.append(answer.status)
    return answer


def _estimated(program: Program, answer: OptimizeResult) -> Optimum:
    dual = float(program.right @ answer.eqlin.marginals)
    return Optimum(-answer.fun, answer.x, abs(dual - answer.fun))


def _proved(program: Program, answer: OptimizeResult) -> Optimum:
    """The exact optimum near the vertex of HiGHS."""
    for threshold in _TRIES:
        vertex = _optimal_vertex(program, answer, threshold)
        if vertex is not None:
            return Optimum((program.cost * vertex).sum(), vertex)
    raise NumericalError(
        "the vertex that the linear program's solver finds could not be proved optimal in "
        "rational arithmetic"
    )


def _optimal_vertex(program: Program, answer: OptimizeResult, threshold: float) -> Numbers | None:
    """An exact vertex that is proved optimal, or None."""
    x: Floats = np.asarray(answer.x)
    reduced: Floats = np.abs(np.asarray(answer.lower.marginals))
    positive = x > _SMALL * max(1.0, float(np.abs(x).max(initial=0.0)))
    free = ~positive & (reduced <= threshold * max(1.0, float(reduced.max(initial=0.0))))
    # Positive columns first, by decreasing value, then the others by increasing reduced cost.
    order = np.lexsort((np.where(positive, -x, reduced), ~positive))
    candidates = order[(positive | free)[order]].tolist()
    columns = program.exact_columns
    basis = [candidates[k] for k in _independent([columns[j] for j in candidates])]
    by_row: list[Row[Number]] = [{} for _ in program.right]
    for k, j in enumerate(basis):
        for i, v in columns[j].items():
            by_row[i][k] = v
    rows = _independent(by_row)
    for _ in range(_PIVOTS):
        vertex = _Vertex(program, basis, rows)
        step = vertex.improving_step()
        if step is None:
            return vertex.solution()
        leaving, entering = step
        if entering is None:
            return None
        basis = [*basis[:leaving], entering, *basis[leaving + 1 :]]
    return None


def _independent(vectors: Sequence[Row[Number]]) -> list[int]:
    """The numbers of the first independent vectors, modulo a prime."""
    import flint

    length = 1 + max((i for v in vectors for i in v), default=0)
    matrix = flint.nmod_mat(length, len(vectors), _PRIME)
    for k, vector in enumerate(vectors):
        for i, value in vector.items():
            matrix[i, k] = int(value.p) * pow(int(value.q), -1, _PRIME) % _PRIME
    reduced, rank = matrix.rref()
    pivots, k = [], 0
    for i in range(rank):
        while int(reduced[i, k]) == 0:
            k += 1
        pivots.append(k)
    return pivots


class _Vertex:
    """A basis (columns) that is regular on some rows, with its exact solution.

    x: the values of the basis. reduced: the exact reduced cost (cost - y A) of every column.
    """

    def __init__(self, program: Program, basis: Sequence[int], rows: Sequence[int]) -> None:
        import flint

        self.program, self.basis, self.rows = program, basis, rows
        index = {r: i for i, r in enumerate(rows)}
        self.matrix = flint.fmpq_mat(len(rows), len(rows))
        for k, j in enumerate(basis):
            for i, value in program.exact_columns[j].items():
                if i in index:
                    self.matrix[index[i], k] = value
        cost = [flint_number(c) for c in program.cost]
        self.x = self._solved(self.matrix, [flint_number(program.right[i]) for i in rows])
        dual = self._dual([cost[j] for j in basis])
        self.reduced = [c - _dot(a, dual) for a, c in zip(program.exact_columns, cost, strict=True)]

    @staticmethod
    def _solved(matrix: fmpq_mat, right: Sequence[Number]) -> list[Number]:
        import flint

        return list(matrix.solve(flint.fmpq_mat(len(right), 1, right)).entries()) if right else []

    def _dual(self, weights: Sequence[Number]) -> Row[Number]:
        """The y with y B = weights, by row."""
        return dict(zip(self.rows, self._solved(self.matrix.transpose(), weights), strict=True))

    def improving_step(self) -> tuple[int, int | None] | None:
        """The position of the basis that leaves and the column that enters (Bland's rule).

        Returns:
            None at an optimal vertex. The column is None if the basis is neither feasible nor dual
            feasible, or there is no such column.
        """
        entering = next((j for j, v in enumerate(self.reduced) if v > 0), None)
        negative = next((k for k, v in enumerate(self.x) if v < 0), None)
        if negative is None:
            return None if entering is None else self._primal_step(entering)
        return (negative, None) if entering is not None else self._dual_step(negative)

    def _primal_step(self, entering: int) -> tuple[int, int | None]:
        column = self.program.exact_columns[entering]
        step = self._solved(self.matrix, [column.get(i, 0) for i in self.rows])
        ratios = [
            (x / d, self.basis[k], k)
            for k, (x, d) in enumerate(zip(self.x, step, strict=True))
            if d > 0
        ]
        return (min(ratios)[2], entering) if ratios else (0, None)

    def _dual_step(self, leaving: int) -> tuple[int, int | None]:
        row = self._dual([int(k == leaving) for k in range(len(self.basis))])
        slopes = [_dot(a, row) for a in self.program.exact_columns]
        ratios = [(self.reduced[j] / s, j) for j, s in enumerate(slopes) if s < 0]
        # The slope of columns of the basis is 0 or 1.
        return leaving, min(ratios)[1] if ratios else None

    def solution(self) -> Numbers | None:
        """All values; None if they violate an equation outside of the rows."""
        left: list[Number] = [0] * len(self.program.right)
        for j, x in zip(self.basis, self.x, strict=True):
            for i, value in self.program.exact_columns[j].items():
                left[i] += value * x
        if any(v != flint_number(b) for v, b in zip(left, self.program.right, strict=True)):
            return None
        values = full(len(self.program.cost), 0, rational=True)
        values[list(self.basis)] = fractions(self.x)
        return values


def _dot(column: Row[Number], weights: Row[Number]) -> Number:
    return sum((v * weights[i] for i, v in column.items() if i in weights), 0)


def _prove_infeasible(program: Program) -> None:
    """Prove that the least violation is not 0. Raises NumericalError otherwise."""
    n, size = len(program.right), len(program.cost)
    sign = np.where(program.right >= 0, full(n, 1, rational=True), full(n, -1, rational=True))
    cost = np.concatenate((full(size, 0, rational=True), full(n, -1, rational=True)))
    violation = solve_program(
        program.extended(np.arange(n), size + np.arange(n), sign, program.right, cost)
    )
    if violation is None or not violation.value < 0:
        raise NumericalError("a linear program that its solver takes for infeasible is not")


def _prove_unbounded(program: Program) -> None:
    """Find an improving ray and a solution, exactly. Raises NumericalError otherwise."""
    n, size = len(program.right), len(program.cost)
    one, nothing = full(size + 1, 1, rational=True), full(n + size, 0, rational=True)
    ray = solve_program(
        program.extended(
            np.full(size + 1, n),
            np.arange(size + 1),
            one,
            np.append(nothing[:n], one[0]),
            np.append(program.cost, nothing[0]),
        )
    )
    none = np.empty(0, dtype=np.int64)
    point = solve_program(program.extended(none, none, nothing[:0], program.right, nothing[:size]))
    if ray is None or not ray.value > 0 or point is None:
        raise NumericalError("a linear program that its solver takes for unbounded is not")
