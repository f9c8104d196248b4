"""Concurrent games in plain fractions; imports nothing of symcheck.

A game has for each state a matrix of rows: pairs of a reward and a distribution over states. Matrix
games are solved by their kernels (Shapley & Snow 1950): square parts on which strategies equalise.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import combinations
from random import Random

Row = tuple[Fraction, dict[int, Fraction]]
Game = list[list[list[Row]]]


def value(matrix: list[list[Fraction]]) -> Fraction:
    """The value of a matrix game, whose rows the maximiser chooses."""
    shift = 1 - min(map(min, matrix))
    above = [[x + shift for x in row] for row in matrix]
    k, m = len(above), len(above[0])
    for size in range(1, min(k, m) + 1):
        for rows in combinations(range(k), size):
            for columns in combinations(range(m), size):
                part = [[above[i][j] for j in columns] for i in rows]
                mine = _equalising([list(column) for column in zip(*part, strict=True)])
                theirs = _equalising(part)
                if mine is None or theirs is None:
                    continue
                low = min(
                    sum(x * above[i][j] for x, i in zip(mine, rows, strict=True)) for j in range(m)
                )
                high = max(
                    sum(y * row[j] for y, j in zip(theirs, columns, strict=True)) for row in above
                )
                if low == high:
                    return low - shift
    raise AssertionError("each matrix game has a kernel")


def _equalising(part: list[list[Fraction]]) -> list[Fraction] | None:
    """The distribution y for which all entries of part y are equal; None if there is none."""
    n = len(part)
    rows = [[*row, Fraction(1)] for row in part]
    for column in range(n):
        pivot = next((r for r in range(column, n) if rows[r][column]), None)
        if pivot is None:
            return None
        rows[column], rows[pivot] = rows[pivot], rows[column]
        rows[column] = [x / rows[column][column] for x in rows[column]]
        for r in range(n):
            if r != column:
                factor = rows[r][column]
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[column], strict=True)]
    total = sum(row[-1] for row in rows)
    found = [row[-1] / total for row in rows] if total else None
    return found if found and min(found) >= 0 else None


def after_steps(
    game: Game,
    last: list[Fraction],
    steps: int,
    *,
    one_maximises: bool,
    earns: bool = False,
    stays: frozenset[int] = frozenset(),
) -> list[Fraction]:
    """The values after some steps; states in `stays` keep theirs."""
    sign, values = 1 if one_maximises else -1, last

    def worth(row: Row) -> Fraction:
        earned, to = row
        return sign * (earned * earns + sum(p * values[t] for t, p in to.items()))

    for _ in range(steps):
        values = [
            values[s] if s in stays else sign * value([list(map(worth, row)) for row in game[s]])
            for s in range(len(game))
        ]
    return values


def draw(random: Random, states: int, actions: int) -> Game:
    """A random game."""

    def row() -> Row:
        targets = random.sample(range(states), random.randint(1, min(3, states)))
        weights = [random.randint(1, 3) for _ in targets]
        shares = {t: Fraction(w, sum(weights)) for t, w in zip(targets, weights, strict=True)}
        return Fraction(random.randint(-2, 3)), shares

    return [
        [
            [row() for _ in range(width)]
            for width in [random.randint(1, actions)] * random.randint(1, actions)
        ]
        for _ in range(states)
    ]


def text(game: Game) -> str:
    """The game in the language of PRISM-games: rows belong to player one, columns to player two."""
    mine = max(len(matrix) for matrix in game)
    theirs = max(len(row) for matrix in game for row in matrix)
    one = [
        f"  [a{i}] {_in(s for s, matrix in enumerate(game) if i < len(matrix))} -> true;"
        for i in range(mine)
    ]
    two = [
        f"  [b{j}] {_in(s for s, matrix in enumerate(game) if j < len(matrix[0]))} -> true;"
        for j in range(theirs)
    ]
    moves, rewards = [], []
    for s, matrix in enumerate(game):
        for i, row in enumerate(matrix):
            for j, (reward, to) in enumerate(row):
                updates = " + ".join(f"{p}:(s'={t})" for t, p in to.items())
                moves.append(f"  [a{i},b{j}] s={s} -> {updates};")
                rewards.append(f"  [b{j},a{i}] s={s} : {reward};")
    return "\n".join(
        [
            "csg",
            "player one one endplayer",
            "player two two endplayer",
            *("module one", *one, "endmodule"),
            *("module two", *two, "endmodule"),
            *("module state", f"  s : [0..{len(game)}] init 0;", *moves, "endmodule"),
            *("rewards", *rewards, "endrewards"),
        ]
    )


def _in(states: Iterable[int]) -> str:
    return " | ".join(f"s={s}" for s in states) or "false"
