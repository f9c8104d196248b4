"""Linear systems and stationary distributions in rational arithmetic.

Strongly connected components are solved in topological order. Within one, states are eliminated
while that is cheap, in the order of least fill-in; FLINT solves the dense rest by p-adic lifting.
Source: Dixon (1982), 'Exact solution of linear equations using p-adic expansions'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers, Rationals, rationals
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.matrices.rows import SparseMatrix, starts_of
from symcheck.matrices.weights import F
from symcheck.numerics import graph

__all__ = [
    "Number",
    "Row",
    "flint_number",
    "fractions",
    "least_solution",
    "number_form",
    "number_rows",
    "restrict_rows",
    "solve_chain",
    "stationary_distribution",
]

CHEAP_PIVOT = 400
"""Eliminate a state while that takes at most this many products. Later, rows are full and entries
large, and lifting is faster: the steady state of fms with n=2 (810 states) takes 0.5 s, 0.9 s
without elimination, and over 100 s by elimination alone."""

SMALL_SYSTEM = 20
"""Unknowns up to which numbers stay Fractions: loading FLINT takes a tenth of the whole run that
checks the die. All of these unknowns are eliminated: a pivot takes at most 20 * 20 products."""

Number = Any
"""A Fraction or a flint.fmpq (FLINT has no types), or an int."""
Row = dict[int, F]
"""The entries of a row by column."""


def flint_number(value: Number) -> Number:
    """The rational in FLINT's form; a rational function as it is."""
    if isinstance(value, RationalFunction):
        return value
    import flint

    return flint.fmpq(value.numerator, value.denominator)


def number_form(unknowns: int) -> Callable[[Fraction], Number]:
    """The conversion of Fractions to the numbers of a system of equations."""
    return flint_number if unknowns > SMALL_SYSTEM else _fraction


def _fraction(value: Number) -> Number:
    return value if isinstance(value, RationalFunction) else Fraction(value)


def number_rows(matrix: SparseMatrix, form: Callable[[Fraction], F]) -> list[Row[F]]:
    """The rows of a matrix of rationals, in the form of the system."""
    known: dict[Fraction, F] = {}
    data = [known[v] if v in known else known.setdefault(v, form(v)) for v in matrix.data]
    columns, starts = matrix.indices.tolist(), matrix.indptr.tolist()
    return [dict(zip(columns[i:j], data[i:j], strict=True)) for i, j in pairwise(starts)]


def solve_chain(matrix: SparseMatrix, constant: Numbers) -> Rationals:
    """The least solution of x = A x + b over the rationals, where every row is a state.

    Args:
        matrix: A, square, rationals.
        constant: b, one rational per state.

    Returns:
        One rational per state: 0 where no constant other than 0 is ever met.

    Raises:
        NumericalError: the solution is not finite, or not unique.
    """
    form = number_form(matrix.rows)
    return fractions(least_solution(number_rows(matrix, form), [form(c) for c in constant]))


def fractions(values: Sequence[Number]) -> Rationals:
    """Numbers as a vector of Fractions."""
    return rationals(map(_as_fraction, values))


def _as_fraction(value: Number) -> Number:
    if isinstance(value, RationalFunction):
        return value
    return Fraction(int(value.numerator), int(value.denominator))


def least_solution(rows: Sequence[Row[F]], constant: Sequence[F]) -> list[F | int]:
    """The least solution of x = A x + b, where every row is a state."""
    starts = starts_of([len(row) for row in rows])
    columns = np.array([t for row in rows for t in row], dtype=np.int32)
    shape = SparseMatrix(starts, columns, np.ones(len(columns)), len(rows))
    source = np.array([bool(c) for c in constant], dtype=np.bool_)
    parts = graph.sccs(shape, graph.backward_reachable(shape, source))
    x: list[F | int] = [0] * len(rows)
    for c in range(parts.count):
        members = parts.members(c).tolist()
        inner, outer = restrict_rows(rows, constant, members, members, x)
        for s, value in zip(members, _solve(inner, outer), strict=True):
            x[s] = value
    return x


def restrict_rows(
    rows: Sequence[Row[F]],
    constant: Sequence[F],
    chosen: Iterable[int],
    members: Sequence[int],
    x: Sequence[F | int],
) -> tuple[list[Row[F]], list[F]]:
    """The chosen rows over the unknowns `members`, numbered from 0, and their constants.

    The constants include what the rows get from other states, whose values are those of x.
    """
    local = {s: i for i, s in enumerate(members)}
    inner, outer = [], []
    for r in chosen:
        inner.append({local[t]: a for t, a in rows[r].items() if t in local})
        outer.append(sum((a * x[t] for t, a in rows[r].items() if t not in local), constant[r]))
    return inner, outer


def _solve(rows: list[Row[F]], right: list[F]) -> list[F]:
    """Solve x = A x + b within a component."""
    n = len(rows)
    if n == 1:
        rest = 1 - rows[0].get(0, 0)
        if not rest:
            if not right[0]:
                return [right[0]]
            raise NumericalError("the expected reward is infinite")
        return [right[0] / rest]
    return _eliminate_and_lift(rows, right)


def _eliminate_and_lift(rows: list[Row[F]], right: list[F]) -> list[F]:
    """Eliminate states while that is cheap, lift the solution of the rest, and substitute back."""
    import heapq

    n = len(rows)
    rows = [dict(r) for r in rows]
    right = list(right)
    above: list[set[int]] = [set() for _ in range(n)]
    for i, row in enumerate(rows):
        for j in row:
            above[j].add(i)
    queue = [(len(rows[i]) * len(above[i]), i) for i in range(n)]
    heapq.heapify(queue)
    eliminated: list[int] = []
    remaining = set(range(n))
    while queue:
        cost, k = heapq.heappop(queue)
        if k not in remaining:
            continue
        current = len(rows[k]) * len(above[k])
        if current > cost:
            heapq.heappush(queue, (current, k))
            continue
        if cost > CHEAP_PIVOT and not any(
            isinstance(a, RationalFunction) for a in rows[k].values()
        ):
            break
        remaining.discard(k)
        eliminated.append(k)
        _eliminate(k, rows, right, above)
    x = right.copy()
    _lift(sorted(remaining), rows, right, x)
    for k in reversed(eliminated):
        x[k] = sum((a * x[j] for j, a in rows[k].items()), right[k])
    return x


def _lift(states: list[int], rows: Sequence[Row[Any]], right: list[Any], x: list[Any]) -> None:
    """Solve the equations among `states` by p-adic lifting, and write the solution into x."""
    n = len(states)
    if n == 0:
        return
    import flint

    index = {s: i for i, s in enumerate(states)}
    system = flint.fmpq_mat(n, n)
    for i, s in enumerate(states):
        system[i, i] = 1
        for t, a in rows[s].items():
            system[i, index[t]] -= a
    try:
        solution = system.solve(flint.fmpq_mat(n, 1, [right[s] for s in states]), "dixon")
    except ZeroDivisionError:
        raise NumericalError(
            "the equations have no unique solution: some states never leave"
        ) from None
    for i, s in enumerate(states):
        x[s] = solution[i, 0]


def _eliminate(k: int, rows: list[Row[F]], right: list[F], above: list[set[int]]) -> None:
    """Solve row k for its own unknown and put it into all rows that use it."""
    leaving = 1 - rows[k].pop(k, 0)
    if not leaving:
        raise NumericalError("the equations have no unique solution: some states never leave")
    if leaving != 1:
        rows[k] = {j: a / leaving for j, a in rows[k].items()}
        right[k] = right[k] / leaving
    for j in rows[k]:
        above[j].discard(k)
    above[k].discard(k)
    for i in above[k]:
        row = rows[i]
        factor = row.pop(k)
        right[i] = right[i] + factor * right[k]
        for j, a in rows[k].items():
            row[j] = row[j] + factor * a if j in row else factor * a
            above[j].add(i)


def stationary_distribution(matrix: SparseMatrix) -> Rationals:
    """The stationary distribution of an irreducible chain.

    Args:
        matrix: rates or probabilities, rationals; self-loops do not matter.

    Returns:
        One rational per state; they sum to 1.
    """
    n = matrix.rows
    form = number_form(n)
    rows, one, zero = number_rows(matrix, form), form(Fraction(1)), form(Fraction(0))
    if n == 1:
        return fractions([one])
    # With weight 1 at state 0: pi_j * leave_j = sum of pi_i * rate_ij, an equation per state j > 0.
    leave = [sum((a for t, a in row.items() if t != s), zero) for s, row in enumerate(rows)]
    system: list[Row[Number]] = [{} for _ in range(n - 1)]
    right = [zero] * (n - 1)
    for i, row in enumerate(rows):
        for j, a in row.items():
            if j == i or j == 0:
                continue
            if i == 0:
                right[j - 1] = right[j - 1] + a / leave[j]
            else:
                system[j - 1][i - 1] = a / leave[j]
    weights = [one, *_solve(system, right)]
    total = sum(weights, zero)
    return fractions([w / total for w in weights])
