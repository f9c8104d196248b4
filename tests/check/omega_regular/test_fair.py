"""Fair strategies: against strategies that take every choice with a small chance, which are fair whatever they prefer."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from symcheck.errors import UnsupportedError

TREMBLE = Fraction(1, 10**7)


def model(rng, n):
    """A random MDP with an absorbing target n and an absorbing trap n+1; many loops, so that fairness matters."""
    lines = ["mdp", "module m", f"  s : [0..{n + 1}];"]
    for s in range(n):
        for _ in range(rng.choice((1, 2, 3))):
            p = rng.choice((0.25, 0.5, 1.0))
            first, second = rng.sample([s, s, *range(n + 2)], 2)
            lines.append(
                f"  [] s={s} -> (s'={first});"
                if p == 1
                else f"  [] s={s} -> {p}:(s'={first}) + {1 - p}:(s'={second});"
            )
    return "\n".join(
        [*lines, f"  [] s>={n} -> true;", "endmodule", 'rewards "r"', "  true : 1;", "endrewards"]
    )


def reach(chain, target):
    """Probabilities of reaching a state of a chain, in rational arithmetic: chances of chances are too small for doubles."""
    n = len(chain)
    can = {target}
    while more := {s for s in range(n) for t in can if chain[s][t] and s not in can}:
        can |= more
    inner = sorted(can - {target})
    rows = [[Fraction(s == t) - chain[s][t] for t in inner] + [chain[s][target]] for s in inner]
    for i in range(len(inner)):
        pivot = next(r for r in range(i, len(inner)) if rows[r][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for r in range(len(inner)):
            if r != i:
                rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
    found = {s: float(row[-1]) for s, row in zip(inner, rows, strict=True)}
    return [1.0 if s == target else found.get(s, 0.0) for s in range(n)]


def trembling(dense, rows, groups):
    """The chain of a strategy that takes each other choice with a small chance."""
    chain = []
    for row, group in zip(rows, groups, strict=True):
        mean = [sum(dense[r][t] for r in group) / len(group) for t in range(len(groups))]
        chain.append(
            [(1 - TREMBLE) * x + TREMBLE * y for x, y in zip(dense[row], mean, strict=True)]
        )
    return chain


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(seed=st.integers(0, 2**20), direction=st.sampled_from(["min", "max"]))
def test_trembling_strategies(seed, direction):
    rng = Random(seed)
    n = rng.randint(1, 4)
    engine = engine_of(model(rng, n))
    matrix, column = engine.matrix, engine.explored.states.column(0)
    if n not in column:
        return
    target = int(np.flatnonzero(column == n)[0])
    dense = [[Fraction(0)] * matrix.states for _ in range(matrix.rows)]
    for r in range(matrix.rows):
        for k in range(matrix.indptr[r], matrix.indptr[r + 1]):
            dense[r][matrix.indices[k]] += Fraction(float(matrix.data[k]))
    groups = [range(matrix.groups[s], matrix.groups[s + 1]) for s in range(matrix.states)]
    values = [reach(trembling(dense, rows, groups), target) for rows in product(*groups)]
    want = (np.min if direction == "min" else np.max)(values, axis=0)
    found, _ = check_text(engine, f"P{direction}=? [ F s={n} ]", fairness=True).values.at(
        engine.all
    )
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
