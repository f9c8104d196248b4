"""Optimal mixed strategies of matrix games, compared with their values in fractions."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import numpy as np
import pytest

from oracles import concurrent
from symcheck.numerics.matrix_games import optimal_strategies


@pytest.mark.parametrize(
    ("rows", "columns"), [(1, 1), (1, 4), (3, 1), (2, 2), (3, 3), (2, 5), (4, 3)]
)
@pytest.mark.parametrize("largest", [1, 20])  # small entries: many ties, and degenerate games
def test_what_strategies_ensure_is_the_value(rows, columns, largest):
    random = Random(f"{rows},{columns},{largest}")
    games = [
        [[random.randint(-largest, largest) for _ in range(columns)] for _ in range(rows)]
        for _ in range(40)
    ]
    mine, theirs = optimal_strategies(np.array(games, float))
    assert (mine.shape, theirs.shape) == ((40, rows), (40, columns))
    for game, x, y in zip(games, mine, theirs, strict=True):
        value = concurrent.value([list(map(Fraction, row)) for row in game])
        payoffs = np.array(game, float)
        assert min(*x, *y, 0) == 0
        assert (x.sum(), y.sum()) == (pytest.approx(1), pytest.approx(1))
        assert (x @ payoffs).min() == pytest.approx(float(value), abs=1e-11)
        assert (payoffs @ y).max() == pytest.approx(float(value), abs=1e-11)


def test_many_actions():
    """Whoever names the other one's number wins: 1/n."""
    mine, theirs = optimal_strategies(np.eye(40)[None])
    assert mine[0] == pytest.approx(np.full(40, 1 / 40))
    assert theirs[0] == pytest.approx(np.full(40, 1 / 40))


@pytest.mark.parametrize("scale", [1e-200, 1e-8, 1e8, 1e200])
def test_scales(scale):
    payoffs = scale * np.array([[[0.0, -1.0, 2.0], [1.0, 0.0, -1.0], [-2.0, 1.0, 0.0]]])
    mine, theirs = optimal_strategies(payoffs)
    assert mine[0] == pytest.approx([0.25, 0.5, 0.25])
    assert theirs[0] == pytest.approx([0.25, 0.5, 0.25])
