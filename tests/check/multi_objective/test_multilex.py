"""Lexicographic queries: against every memoryless strategy, and by hand."""

from __future__ import annotations

from fractions import Fraction
from math import inf
from random import Random

import pytest

from check.multi_objective.test_multi import FORK, LOOPS, absorbing, ask, strategies
from checking import check_text, engine_of
from symcheck.errors import UnsupportedError


@pytest.mark.parametrize("engine", ["exact", "explicit", "hybrid"])
def test_the_first_objective_matters_most(engine):
    # Action a at once gives s=2 its 0.6; each other choice before loses some of it.
    query = "multilex(Pmax=? [ F s=2 ], Pmax=? [ F s=1 ], Pmax=? [ F s=3 ])"
    assert ask(query, FORK, engine) == [
        (pytest.approx(0.6), pytest.approx(0.4), pytest.approx(0, abs=1e-9))
    ]
    query = 'multilex(Pmax=? [ F s=3 ], R{"try"}min=? [ C ])'
    assert ask(query, FORK, engine) == [(pytest.approx(1), pytest.approx(2))]
    # Without having to reach s=3, nothing is tried.
    query = 'multilex(R{"try"}min=? [ C ], Pmax=? [ F s=3 ])'
    assert ask(query, FORK, engine) == [(pytest.approx(0, abs=1e-9), pytest.approx(0, abs=1e-9))]
    query = "multilex(Pmax=? [ F s=3 ], Pmax=? [ F s=1 ], P>=0.3 [ F s=2 ])"
    assert ask(query, FORK, engine) == [
        (
            pytest.approx(0.5),
            pytest.approx(0.2),
        )
    ]
    assert ask("multilex(Pmax=? [ F s=1 ], P>=0.7 [ F s=2 ])", FORK, engine) == []


def test_end_components_must_be_left():
    # All actions of the cycle are optimal for reaching s=2; a strategy must still go there.
    for first in ("F s=2", "G F s=2"):
        query = f'multilex(Pmax=? [ {first} ], R{{"r"}}max=? [ F s=2 ])'
        assert ask(query, LOOPS, "exact") == [(1, inf)]
        query = f"multilex(Pmax=? [ {first} ], Tmin=? [ F s=2 ])"
        assert ask(query, LOOPS, "exact") == [(1, 1)]


def test_long_run_after_reachability():
    # All strategies that reach s=2 end there, so that nothing is earned in the long run.
    query = 'multilex(Pmax=? [ F s=2 ], R{"r"}max=? [ S ])'
    assert ask(query, LOOPS, "exact") == [(1, 0)]
    query = 'multilex(R{"r"}max=? [ S ], Pmax=? [ F s=2 ])'
    assert ask(query, LOOPS, "exact") == [(Fraction(7, 4), 0)]
    # Visiting s=1 for ever leaves the average free; the cost of that has no bound.
    query = 'multilex(Pmax=? [ G F s=1 ], Smax=? [ s=4 ], R{"r"}min=? [ C ])'
    assert ask(query, LOOPS, "exact") == [(1, 1, inf)]


def test_refusals():
    with pytest.raises(UnsupportedError, match="last place"):
        ask('multilex(R{"loop"}max=? [ C ], Pmax=? [ F s=1 ])')
    with pytest.raises(UnsupportedError, match="needs objectives with"):
        ask("multilex(P>=0.1 [ F s=1 ])")


@pytest.mark.parametrize("seed", range(12))
def test_optima_against_all_strategies(seed):
    rng = Random(seed)
    n = rng.randint(2, 3)
    engine = engine_of(absorbing(rng, n, 3))
    columns = engine.explored.states.column(0)
    targets = [columns == n + i for i in range(3)]
    points = list(strategies(engine.matrix, targets, int(engine.explored.initial[0])))
    best = list(points)
    for i in range(3):
        value = max(p[i] for p in best)
        best = [p for p in best if p[i] > value - 1e-9]
    query = ", ".join(f"Pmax=? [ F s={n + i} ]" for i in range(3))
    (found,) = check_text(engine, f"multilex({query})").value
    assert found == pytest.approx(tuple(best[0]), abs=1e-7)
