"""Fair strategies: against strategies that take every choice with a small chance, which are fair whatever they prefer."""

from __future__ import annotations

from itertools import product
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from symcheck.errors import UnsupportedError

TREMBLE = 1e-7


def model(rng, n):
    """A random MDP with an absorbing target n and an absorbing trap n+1; many loops, so that fairness matters."""
    lines = ["mdp", "module m", f"  s : [0..{n + 1}];"]
    for s in range(n):
        for _ in range(rng.choice((1, 2, 3))):
            p = rng.choice((0.25, 0.5, 1.0))
            first, second = rng.sample([s, s, *range(n + 2)], 2)
            lines.append(f"  [] s={s} -> (s'={first});" if p == 1 else f"  [] s={s} -> {p}:(s'={first}) + {1 - p}:(s'={second});")
    return "\n".join([*lines, f"  [] s>={n} -> true;", "endmodule", 'rewards "r"', "  true : 1;", "endrewards"])


def reach(chain, target):
    """Probabilities of reaching a state of a chain, by elimination among the states that can."""
    can = np.zeros(len(chain), bool)
    can[target] = True
    for _ in chain:
        can |= (chain[:, can] > 0).any(axis=1)
    unknown = can.copy()
    unknown[target] = False
    x = np.zeros(len(chain))
    x[target] = 1
    inner = np.flatnonzero(unknown)
    x[inner] = np.linalg.solve(np.eye(len(inner)) - chain[np.ix_(inner, inner)], chain[inner, target])
    return x


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**20), direction=st.sampled_from(["min", "max"]))
def test_trembling_strategies(seed, direction):
    rng = Random(seed)
    n = rng.randint(1, 4)
    engine = engine_of(model(rng, n))
    matrix, column = engine.matrix, engine.explored.states.column(0)
    if n not in column:
        return
    target = int(np.flatnonzero(column == n)[0])
    dense = np.zeros((matrix.rows, matrix.states))
    for r in range(matrix.rows):
        span = slice(matrix.indptr[r], matrix.indptr[r + 1])
        dense[r, matrix.indices[span]] += matrix.data[span]
    groups = [range(matrix.groups[s], matrix.groups[s + 1]) for s in range(matrix.states)]
    mean = np.array([dense[list(g)].mean(axis=0) for g in groups])
    values = [reach((1 - TREMBLE) * dense[list(rows)] + TREMBLE * mean, target) for rows in product(*groups)]
    want = (np.min if direction == "min" else np.max)(values, axis=0)
    found, _ = check_text(engine, f"P{direction}=? [ F s={n} ]", fairness=True).values.at(engine.all)
    assert found == pytest.approx(want, abs=1e-4)


LOOP = """mdp
module m
  s : [0..2];
  [] s=0 -> true;
  [] s=0 -> 0.5:(s'=1) + 0.5:(s'=2);
  [] s>0 -> true;
endmodule
rewards "r"
  s=0 : 1;
endrewards
"""


def test_by_hand():
    engine = engine_of(LOOP)
    assert check_text(engine, "Pmin=? [ F s>0 ]").value == 0
    assert check_text(engine, "Pmin=? [ F s>0 ]", fairness=True).value == 1
    assert check_text(engine, "Pmin=? [ F s=1 ]", fairness=True).value == 0.5
    assert check_text(engine, "Pmax=? [ G s=0 ]", fairness=True).value == 0
    assert check_text(engine, "Pmax=? [ G F s=0 ]", fairness=True).value == 0
    assert check_text(engine, "P>=1 [ F s>0 ]", fairness=True).value is True


@pytest.mark.parametrize("text", ["Rmin=? [ F s=1 ]", "Rmax=? [ F s>0 ]", "Rmin=? [ C ]"])
def test_rewards_that_fairness_changes_are_refused(text):
    with pytest.raises(UnsupportedError, match="fair"):
        check_text(engine_of(LOOP), text, fairness=True)
