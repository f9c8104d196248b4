"""Equilibria of bimatrix games in plain fractions; imports nothing of symcheck.

Nash equilibria are found by supports: if one side plays rows of a set only, and the other one
columns of a set only, all of which are best responses, the two choose within polytopes of their
own. Optima of linear functions are taken over the vertices of polytopes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import combinations

Matrix = Sequence[Sequence[Fraction]]
Point = list[Fraction]
Pair = tuple[Fraction, Fraction]


def nash(first: Matrix, second: Matrix, *, fair: bool = False) -> Pair:
    """The payoffs in the best Nash equilibrium: the greatest sum, or the least difference and of
    these the greatest sum; of equal ones that with the greatest first payoff.
    """
    found = []
    columns_of_second = list(zip(*second, strict=True))
    for rows in _subsets(len(first)):
        for columns in _subsets(len(first[0])):
            mine = _payoffs(first, rows, columns)  # of the side of rows, which the other one gives
            theirs = _payoffs(columns_of_second, columns, rows)
            if mine and theirs:
                low, high = max(min(mine), min(theirs)), min(max(mine), max(theirs))
                if not fair:
                    found.append((max(mine), max(theirs)))
                elif low <= high:
                    found.append((high, high))
                else:
                    found += [(a, b) for a in mine for b in theirs]
    return _best(found, fair)


def correlated(first: Matrix, second: Matrix, *, fair: bool = False) -> Pair:
    """The payoffs in the best correlated equilibrium."""
    k, m = len(first), len(first[0])
    n = k * m
    inequalities = [[Fraction(i == j) for i in range(n)] for j in range(n)]
    for a in range(k):
        for b in range(k):
            row = [Fraction(0)] * n
            for j in range(m):
                row[a * m + j] = first[a][j] - first[b][j]
            inequalities.append(row)
    for a in range(m):
        for b in range(m):
            row = [Fraction(0)] * n
            for i in range(k):
                row[i * m + a] = second[i][a] - second[i][b]
            inequalities.append(row)
    one = [x for row in first for x in row]
    other = [x for row in second for x in row]
    difference = [x - y for x, y in zip(one, other, strict=True)]
    halves = [difference, [-x for x in difference]] if fair else [None]
    ones = [[Fraction(1)] * n]
    points = [  # the difference has one sign on a half
        p for half in halves for p in _vertices(ones, inequalities + ([half] if half else []))
    ]
    return _best([(_dot(p, one), _dot(p, other)) for p in points], fair)


def _best(found: list[Pair], fair: bool) -> Pair:
    return max(found, key=lambda p: (-abs(p[0] - p[1]) if fair else 0, p[0] + p[1], p[0]))


def _subsets(n: int) -> Iterator[tuple[int, ...]]:
    return (s for size in range(1, n + 1) for s in combinations(range(n), size))


def _payoffs(matrix: Matrix, best: Sequence[int], used: Sequence[int]) -> list[Fraction]:
    """The payoffs of rows that are all best responses to a mixture of columns, at its vertices."""
    top = [matrix[best[0]][j] for j in used]
    equal = [[matrix[i][j] - t for j, t in zip(used, top, strict=True)] for i in best[1:]]
    above = [[t - row[j] for j, t in zip(used, top, strict=True)] for row in matrix]
    positive = [[Fraction(i == j) for i in range(len(used))] for j in range(len(used))]
    ones = [[Fraction(1)] * len(used)]
    return [_dot(p, top) for p in _vertices(ones, positive + above, equal)]


def _vertices(sums: Matrix, least: Matrix, zero: Matrix = ()) -> list[Point]:
    """The points at which sums are 1, some are 0, and others at least 0, and that are vertices."""
    n, found = len(sums[0]), []
    fixed = [[*row, Fraction(1)] for row in sums] + [[*row, Fraction(0)] for row in zero]
    for size in range(n):
        for tight in combinations(least, size):
            point = _solution([*fixed, *([*row, Fraction(0)] for row in tight)], n)
            if point and all(_dot(row, point) >= 0 for row in least):
                found.append(point)
    return found


def _solution(rows: list[list[Fraction]], n: int) -> Point | None:
    """The only solution of equations with n unknowns; None if there is none or there are more."""
    rows = [list(row) for row in rows]
    for column in range(n):
        pivot = next((r for r in range(column, len(rows)) if rows[r][column]), None)
        if pivot is None:
            return None
        rows[column], rows[pivot] = rows[pivot], rows[column]
        rows[column] = [x / rows[column][column] for x in rows[column]]
        for r in range(len(rows)):
            if r != column and rows[r][column]:
                factor = rows[r][column]
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    return None if any(row[-1] for row in rows[n:]) else [row[-1] for row in rows[:n]]


def _dot(xs: Sequence[Fraction], ys: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(xs, ys, strict=True)), Fraction(0))
