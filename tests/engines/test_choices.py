"""The solution of equations carries the choices that attain it, on every engine."""

from __future__ import annotations

import numpy as np
import pytest

import symcheck
from checking import LOSSY
from symcheck.direction import Direction
from symcheck.engines.capabilities import HasActions
from symcheck.numerics.settings import Accuracy

ENGINES = ["explicit", "exact", "sparse", "hybrid", "mtbdd"]


def chosen(engine, direction: Direction, settings: Accuracy) -> list[str] | None:
    """The actions by which s=2 is reached with the best probability from s=0 and s=1."""
    values = [v[0] for v in engine.valuations(engine.all)]
    unknown, goal = (engine.from_bools(np.isin(values, states)) for states in ([0, 1], [2]))
    system = engine.system(unknown, direction)
    solved = system.reachability(goal).solve([(goal, 1.0)], settings)
    if solved.choices is None:
        return None
    groups = engine.system(engine.all).groups
    rows = groups[:-1][engine.numbers(unknown)] + solved.choices
    return [engine.model.actions[a] for a in engine.capability(HasActions).row_actions()[rows]]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_solution_has_the_choices_that_attain_it(engine):
    built = symcheck.loads(LOSSY, engine=engine).engine
    wanted = Accuracy(strategy=True)
    assert chosen(built, Direction.MAX, wanted) == ["risk", "on"]
    assert chosen(built, Direction.MIN, wanted) == ["go", "out"]
    assert chosen(built, Direction.MAX, Accuracy()) is None  # nobody asked
