"""Equilibria of bimatrix games: textbook games, and random ones in fractions."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import numpy as np
import pytest

from oracles import equilibria
from symcheck.errors import UnsupportedError
from symcheck.numerics.bimatrix_games import correlated_values, nash_values

DILEMMA = [[3, 0], [5, 1]], [[3, 5], [0, 1]]
SEXES = [[3, 0], [0, 2]], [[2, 0], [0, 3]]
PENNIES = [[1, -1], [-1, 1]], [[-1, 1], [1, -1]]
CHICKEN = [[6, 2], [7, 0]], [[6, 7], [2, 0]]


@pytest.mark.parametrize(
    ("game", "social", "fair"),
    [
        (DILEMMA, (1, 1), (1, 1)),
        (SEXES, (3, 2), (6 / 5, 6 / 5)),
        (PENNIES, (0, 0), (0, 0)),
        (CHICKEN, (14 / 3, 14 / 3), (14 / 3, 14 / 3)),
    ],
)
def test_nash_equilibria_of_textbook_games(game, social, fair):
    for wanted, is_fair in ((social, False), (fair, True)):
        found = nash_values(*np.array(game, float)[:, None], fair=is_fair)
        assert [x.item() for x in found] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize(
    ("game", "social", "fair"),
    [
        (DILEMMA, (1, 1), (1, 1)),
        (SEXES, (3, 2), (5 / 2, 5 / 2)),  # a fair coin
        (PENNIES, (0, 0), (0, 0)),
        (CHICKEN, (21 / 4, 21 / 4), (21 / 4, 21 / 4)),  # Aumann (1974)
    ],
)
def test_correlated_equilibria_of_textbook_games(game, social, fair):
    for wanted, is_fair in ((social, False), (fair, True)):
        found = correlated_values(*np.array(game, float)[:, None], fair=is_fair)
        assert sum(x.item() for x in found) == pytest.approx(sum(wanted), abs=1e-8)
        if is_fair:
            assert [x.item() for x in found] == pytest.approx(wanted, abs=1e-8)


def draw(
    random: Random, rows: int, columns: int, largest: int, games: int
) -> list[tuple[equilibria.Matrix, equilibria.Matrix]]:
    def matrix() -> equilibria.Matrix:
        return [
            [Fraction(random.randint(-largest, largest)) for _ in range(columns)]
            for _ in range(rows)
        ]

    return [(matrix(), matrix()) for _ in range(games)]


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 3), (3, 1), (2, 2), (2, 3), (3, 3)])
@pytest.mark.parametrize("largest", [1, 9])  # small entries: many ties, and degenerate games
@pytest.mark.parametrize("fair", [False, True])
def test_nash_equilibria_of_random_games(rows, columns, largest, fair):
    games = draw(Random(f"{rows},{columns},{largest}"), rows, columns, largest, 20)
    found = np.array(nash_values(*np.array(games, float).swapaxes(0, 1), fair=fair)).T
    for game, values in zip(games, found, strict=True):
        wanted = equilibria.nash(*game, fair=fair)
        assert values == pytest.approx(list(map(float, wanted)), abs=1e-9), game


@pytest.mark.parametrize(("rows", "columns", "count"), [(1, 3, 10), (2, 2, 10)])
@pytest.mark.parametrize("largest", [1, 9])
@pytest.mark.parametrize("fair", [False, True])
def test_correlated_equilibria_of_random_games(rows, columns, count, largest, fair):
    games = draw(Random(f"{rows},{columns},{largest}"), rows, columns, largest, count)
    found = np.array(correlated_values(*np.array(games, float).swapaxes(0, 1), fair=fair)).T
    for game, values in zip(games, found, strict=True):
        wanted = equilibria.correlated(*game, fair=fair)
        assert values == pytest.approx(list(map(float, wanted)), abs=1e-6), game


@pytest.mark.parametrize("scale", [1e-200, 1e-8, 1e8, 1e200])
@pytest.mark.parametrize("values", [nash_values, correlated_values])
def test_scales(scale, values):
    one, other = values(*(scale * np.array(CHICKEN, float)[:, None]), fair=True)
    best = 14 / 3 if values is nash_values else 21 / 4
    assert (one[0], other[0]) == (pytest.approx(scale * best), pytest.approx(scale * best))


def test_payoffs_that_differ_by_rounding_are_equal():
    """Otherwise, the second side would have to leave the first one without anything."""
    first, second = np.array([[[0.0, 5.0]]]), np.array([[[0.1 + 0.2, 0.3]]])
    assert nash_values(first, second)[0].tolist() == [5.0]


def test_larger_games():
    """Who names the same number as the other one wins what it says: each is an equilibrium."""
    first = np.diag(np.arange(1.0, 9.0))[None]
    assert [x.item() for x in nash_values(first, first)] == pytest.approx([8.0, 8.0])
    with pytest.raises(UnsupportedError, match="9 and 9 joint actions"):
        nash_values(np.zeros((1, 9, 9)), np.zeros((1, 9, 9)))
    wide = np.arange(100.0)[None, None]
    assert [x.item() for x in nash_values(wide, wide)] == [99.0, 99.0]
