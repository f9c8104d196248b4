"""Paths along stored rows: models from files and from Python are sampled as those with commands."""

from __future__ import annotations

import numpy as np
import pytest

import symcheck
from symcheck.errors import ModelFault, NameFault, UnsupportedError

DTMC = """dtmc
module m
  x : [0..3];
  [a] x=0 -> 0.25:(x'=1) + 0.75:(x'=2);
  [b] x=0 -> (x'=0);
  [c] x>0 & x<3 -> 0.5:(x'=3) + 0.5:(x'=0);
endmodule
label "end" = x=3;
rewards "r" x=1 : 2; [c] true : 1; endrewards
"""
CTMC = """ctmc
module q
  n : [0..3];
  [in] n<3 -> 2 : (n'=n+1);
  [out] n>0 -> 3 : (n'=n-1);
endmodule
label "end" = n=3;
rewards "r" n>0 : n; [in] true : 5; endrewards
"""
MDP = DTMC.replace("dtmc", "mdp")
QUERIES = [
    'P=? [ F "end" ]',
    "P=? [ F<=3 {goal} ]",
    "P=? [ {start} U {goal} ]",
    'P=? [ X "init" ]',
    'P=? [ G<=2 !"deadlock" ]',
    'R{"r"}=? [ F "end" ]',
    'R{"r"}=? [ C<=2 ]',
    'R{"r"}=? [ I=1 ]',
    'T=? [ F "end" ]',
]


def read(text, tmp_path, **options):
    model = symcheck.loads(text)
    symcheck.export(model, str(tmp_path / "m.all"))
    return symcheck.load_explicit(str(tmp_path / "m.all"), type=model.bound.type, **options)


@pytest.mark.parametrize("text", [DTMC, CTMC])
@pytest.mark.parametrize("query", QUERIES)
@pytest.mark.parametrize("engine", ["auto", "sparse"])
def test_estimates_are_near_the_value(text, query, engine, tmp_path):
    name = "x" if text is DTMC else "n"
    formula = query.replace("{goal}", f"({name}=3)").replace("{start}", f"({name}<2)")
    model = read(text, tmp_path, engine=engine)
    result = model.estimate(formula, samples=4000, seed=5)
    exact = model.check(formula).value
    low, high = result.accuracy.lower, result.accuracy.upper
    assert low - (high - low) <= exact <= high + (high - low)
    # The same paths as from the commands, up to the order of the transitions: the same law.
    commands = symcheck.loads(text).estimate(formula, samples=4000, seed=5)
    assert abs(commands.value - result.value) <= 2 * (high - low) + 1e-12


def test_choices_of_an_mdp_are_equally_likely(tmp_path):
    result = read(MDP, tmp_path).estimate('Tmax=? [ F "end" ]', samples=4000, seed=1)
    chain = symcheck.loads(DTMC).check('T=? [ F "end" ]').value
    assert result.value == pytest.approx(chain, rel=0.05)
    assert "uniformly at random" in result.warnings[0]


def test_models_from_python():
    walk = symcheck.from_matrix([[0.5, 0.5, 0], [0, 0.5, 0.5], [0, 0, 1]], labels={"end": [2]})
    assert walk.estimate('T=? [ F "end" ]', samples=4000, seed=2).value == pytest.approx(
        4, rel=0.05
    )
    assert walk.estimate("P>0.2 [ F<=3 s=2 ]", samples=4000, seed=2).value is True

    def roll(state):
        return {min(state + 1, 3): 0.5, 0: 0.5}

    dice = symcheck.from_function(0, roll, rewards={"steps": lambda s: 1 if s < 3 else 0})
    result = dice.estimate('R{"steps"}=? [ F s=3 ]', samples=4000, seed=2)
    assert result.value == pytest.approx(14, rel=0.05)
    assert dice.estimate("P=? [ F (P>0.4 [ X s=3 ]) ]", samples=200, seed=2).value == 1


def test_rewards_of_single_transitions():
    rewards = {"r": (None, np.array([[0, 4.0], [0, 0]]))}
    model = symcheck.from_matrix([[0.5, 0.5], [0, 1]], rewards=rewards)
    assert model.estimate('R{"r"}=? [ F s=1 ]', samples=50, seed=1).value == 4


def test_a_chain_under_a_strategy():
    model = symcheck.loads(MDP, strategy=True)
    chain = symcheck.induced_chain(model, model.check('Pmax=? [ F<=3 "end" ]'))
    exact = chain.check('P=? [ F<=3 "end" ]').value
    assert chain.estimate('P=? [ F<=3 "end" ]', samples=4000, seed=1).value == pytest.approx(
        exact, abs=0.03
    )


def test_refusals(tmp_path):
    model = read(DTMC, tmp_path)
    with pytest.raises(NameFault, match="none"):
        model.estimate('P=? [ F "none" ]')
    with pytest.raises(UnsupportedError, match="rational arithmetic"):
        model.with_options(exact=True).estimate('P=? [ F "end" ]')
    (tmp_path / "d.tra").write_text("2 1\n0 1 1\n")
    with pytest.raises(ModelFault, match="deadlock"):
        symcheck.load_explicit(str(tmp_path / "d.tra"), fix_deadlocks=False).estimate(
            "P=? [ F x=1 ]"
        )
    with pytest.raises(UnsupportedError, match="one initial state"):
        symcheck.from_matrix([[0, 1], [1, 0]], initial=[0, 1]).estimate("P=? [ F s=1 ]")
