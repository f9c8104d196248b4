"""Counterexamples of LTL formulas, rewards and time bounds: sums against exact values, paths by hand."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from math import prod
from pathlib import Path
from random import Random

import numpy as np
import pytest
from scipy.linalg import expm

import symcheck
from symcheck.cli import main
from symcheck.errors import UnsupportedError
from symcheck.numerics.transient.phase_type import least_probability_within
from symcheck.semantics.interpreter import choices

MODELS = Path(__file__).parents[3] / "models"
DIE = MODELS / "die/die.pm"
STAKES = MODELS / "gambler/stakes.nm"


def step_probability(model, before, after):
    enabled = choices(model.bound, before.valuation)
    out = sum(Fraction(p) for c in enabled for p, _ in c.branches)
    return sum(Fraction(p) for c in enabled for p, t in c.branches if t == after.valuation) / out


def replayed(model, path):
    """The probability of a path of a chain, by the interpreter."""
    return prod(step_probability(model, a, b) for a, b in pairwise(path.states))


def extended(model, state, seed):
    """A random run of at least six states, until the die has fallen."""
    generator, run = Random(seed), [state]
    while len(run) < 6 or run[-1][0] != 7:
        branches = choices(model.bound, run[-1])[0].branches
        run.append(generator.choices([t for _, t in branches], [float(p) for p, _ in branches])[0])
    return run


LONGER = {
    "F (s=2 & (X s=6))": lambda s, d: any(a == 2 and b == 6 for a, b in pairwise(s)),
    "(F s=3) & (F d=2)": lambda s, d: 3 in s and d[-1] == 2,
    'F{"tosses"}<=3 d>3': lambda s, d: any(x > 3 for x in d[:4]),
    'F{"tosses"}>3 d>3': lambda s, d: d[-1] > 3 and d[3] == 0,
    "F[2,4] d>3": lambda s, d: any(x > 3 for x in d[2:5]),
    "G F d=6": lambda s, d: d[-1] == 6,
    "F G (d=1 | d=2)": lambda s, d: d[-1] in (1, 2),
    "X X s=4": lambda s, d: s[2] == 4,
    "G (s=1 => (F d=2))": lambda s, d: 1 not in s or d[-1] == 2,
}


@pytest.mark.parametrize("engine", ["exact", "sparse"])
@pytest.mark.parametrize("text", LONGER)
@pytest.mark.parametrize("lower", [False, True])
def test_paths_after_which_an_ltl_formula_holds(text, lower, engine):
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    die = symcheck.load(DIE, **options)
    value = Fraction(symcheck.load(DIE, exact=True).check(f"P=? [ {text} ]").value)
    bound = f">={value + Fraction(1, 100)}" if lower else f"<={value - Fraction(1, 100)}"
    found = die.check(f"P{bound} [ {text} ]").counterexample()
    assert found.refutes
    assert found.satisfies is not lower
    assert found.complete, found.summary
    assert found.probability > found.threshold
    assert found.probability <= (1 - value if lower else value) + Fraction(1, 10**12)
    assert len({tuple(p.states) for p in found.paths}) == len(found.paths)
    for path in found.paths:
        assert float(path.probability) == pytest.approx(float(replayed(die, path)))
        for seed in range(3):  # however the path goes on
            s, d = zip(*extended(die, path[-1].valuation, seed), strict=True)
            before = [tuple(state.values()) for state in path[:-1]]
            s, d = (tuple(v[i] for v in before) + rest for i, rest in enumerate((s, d)))
            assert LONGER[text](s, d) is not lower


@pytest.mark.parametrize(
    "formula",
    ['P<=0.1 [ F (money=2 & (F "rich")) ]', 'P<=0.25 [ F[1,3] "rich" ]', 'P>=0.3 [ F (money>3 & (F "rich")) ]'],
)  # fmt: skip
def test_ltl_of_an_mdp_follows_one_strategy(formula):
    model = symcheck.load(STAKES)
    found = model.check(formula).counterexample()
    if not found.refutes:
        assert found.complete
        return
    assert found.complete, found.summary
    for path in found.paths:
        product = 1.0
        for (a, b), action in zip(pairwise(path.states), path.actions, strict=True):
            product *= max(
                sum(float(p) for p, t in c.branches if t == b.valuation)
                for c in choices(model.bound, a.valuation)
                if (c.action or "") == action
            )
        assert product == pytest.approx(float(path.probability))


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("bound", ["<=3", "<7/2", "<3.6"])
def test_rewards_of_paths_exceed_a_bound(bound, exact):
    die = symcheck.load(DIE, exact=exact)
    found = die.check(f'R{{"tosses"}}{bound} [ F s=7 ]').counterexample()
    assert found.refutes
    assert found.complete
    need = Fraction(bound.strip("<="))
    assert found.threshold == need
    total = sum(replayed(die, p) * (len(p) - 1) for p in found.paths)
    assert all(p.reward == len(p) - 1 for p in found.paths)
    assert float(found.reward) == pytest.approx(float(total))
    assert total > need if bound[1] == "=" else total >= need
    assert f"more than {bound[2:]}" in found.summary or "at least" in found.summary
    assert "paths with probability" in found.summary


def test_a_lower_bound_of_a_reward_that_holds_has_a_witness():
    found = symcheck.load(DIE).check('R{"tosses"}>=3.5 [ F s=7 ]').counterexample()
    assert (found.refutes, found.complete) == (False, True)
    with pytest.raises(UnsupportedError, match="that is false, and R>=r"):
        symcheck.load(DIE).check('R{"tosses"}>=4 [ F s=7 ]').counterexample()


def test_an_infinite_reward_is_shown_by_a_path_that_misses_the_target():
    found = symcheck.load(DIE).check('R{"tosses"}<=100 [ F d=6 ]').counterexample()
    assert found.complete
    assert len(found.paths) == 1
    assert "infinite, because the target is missed" in found.note
    assert found.paths[0][-1]["d"] != 6


def test_rewards_of_an_mdp():
    text = """mdp module m s:[0..2];
      [slow] s=0 -> 0.5:(s'=0) + 0.5:(s'=1); [fast] s=0 -> (s'=2);
      [] s=1 -> (s'=2);
    endmodule rewards [slow] true : 3; [fast] true : 1; s=1 : 1; endrewards"""
    for exact in (True, False):
        model = symcheck.loads(text, exact=exact)
        assert model.check("Rmax=? [ F s=2 ]").value == pytest.approx(7)
        found = model.check("R<=6 [ F s=2 ]").counterexample()
        assert found.complete
        assert {a for p in found.paths for a in p.actions} == {"slow", ""}
        assert [float(p.reward) for p in found.paths[:3]] == [4, 7, 10]
        late = model.check("T<=2 [ F s=2 ]").counterexample()
        assert late.complete
        assert [float(p.reward) for p in late.paths[:2]] == [2, 3]


@pytest.mark.parametrize("rates", [[2.0], [1.0, 3.0], [5.0, 5.0, 5.0], [0.01, 100.0, 7.0, 7.0], []])
@pytest.mark.parametrize("time", [0.1, 1.0, 20.0])
def test_the_time_of_a_path(rates, time):
    found = least_probability_within(rates, time)
    n = len(rates)
    generator = np.zeros((n + 1, n + 1))
    for i, rate in enumerate(rates):
        generator[i, i], generator[i, i + 1] = -rate, rate
    wanted = expm(generator * time)[0, n]
    assert found <= wanted * (1 + 1e-9)
    assert found == pytest.approx(wanted, rel=1e-6, abs=1e-13)


def test_time_bounds_of_a_ctmc():
    model = symcheck.load(MODELS / "queue/queue.sm")
    value = model.check("P=? [ n<2 U<=1 n=2 ]").value
    for formula in (f"P<={value * 0.95} [ n<2 U<=1 n=2 ]", f"P>={value * 0.95} [ n<2 U<=1 n=2 ]"):
        found = model.check(formula).counterexample()
        assert found.complete
        assert value * 0.95 <= found.probability <= value * (1 + 1e-9)
        assert [p.probability for p in found.paths] == sorted(
            (p.probability for p in found.paths), reverse=True
        )
        assert all(p[-1]["n"] == 2 for p in found.paths)
    with pytest.raises(UnsupportedError, match="counterexamples of time bounds are supported for"):
        model.check("P>=0.999999 [ n<2 U<=1 n=2 ]").counterexample()


def test_files_say_what_paths_earn(tmp_path, capsys):
    words = [str(DIE), "-pf", 'R{"tosses"}<=3 [ F s=7 ]', "-counterexample"]
    assert main([*words, "-exportcounterexample", str(tmp_path / "c.json")]) == 0
    out = capsys.readouterr().out
    assert "(earns 3): (s=0, d=0) -> " in out
    assert '"reward": 3' in (tmp_path / "c.json").read_text()


def test_commands_of_another_strategy_are_announced():
    found = symcheck.load(STAKES).check('P<=0.2 [ F "rich" ]').counterexample()
    assert "for some strategy, maybe not that of the paths" in str(found.commands)


@pytest.mark.parametrize("engine", ["exact", "explicit", "mtbdd"])
@pytest.mark.parametrize(
    ("path", "shown"),
    [
        ('F{"bets"}<=2 "rich"', lambda money: money[-1] == 8 and len(money) <= 3),
        ('F{"bets"}>2 "rich"', lambda money: money[-1] == 8 and len(money) > 3),
        ('G{"bets"}<=2 money>1', lambda money: all(m > 1 for m in money)),
    ],
)
def test_paths_within_a_reward_follow_a_strategy(path, shown, engine):
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    stakes = symcheck.load(STAKES, **options)
    value = Fraction(symcheck.load(STAKES, exact=True).check(f"Pmax=? [ {path} ]").value)
    found = stakes.check(f"P<={value - Fraction(1, 100)} [ {path} ]").counterexample()
    assert found.refutes
    assert found.complete, found.summary
    assert found.threshold < found.probability <= value + Fraction(1, 10**12)
    taken = {}
    for one in found.paths:
        money = [state["money"] for state in one.states]
        assert shown(money), one
        for step, (source, action) in enumerate(zip(money, one.actions, strict=False)):
            assert taken.setdefault((min(step, 3), source), action) == action


def test_paths_of_a_ctmc_within_a_reward_of_its_transitions():
    text = """ctmc module m x : [0..3];
      [a] x<3 -> 2:(x'=x+1); [b] x>0 & x<3 -> 1:(x'=x-1); endmodule
      rewards "ups" [a] true : 1; [b] true : 1; endrewards"""
    model = symcheck.loads(text)
    found = model.check('P<=0.5 [ F{"ups"}<=5 x=3 ]').counterexample()
    assert [len(p.states) - 1 for p in found.paths] == [3, 5]
    assert found.probability == pytest.approx(4 / 9 + 4 / 27)


def test_what_has_no_counterexample_within_a_reward_says_what_has():
    stakes = symcheck.load(STAKES)
    with pytest.raises(UnsupportedError, match="those of F, G, U, W and R for MDPs too"):
        stakes.check('P<=0.1 [ X{"bets"}<=1 money>0 ]').counterexample()
    with pytest.raises(UnsupportedError, match="a counterexample would need a memory of"):
        stakes.check('P<=0.1 [ F{"bets"}<=3000000 "rich" ]').counterexample()
