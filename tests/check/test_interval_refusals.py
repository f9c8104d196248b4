"""What models with intervals of probabilities do not have is named; what reads no numbers they have."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import NoStrategyError, UnsupportedError

GAME = """mdp
module m
  s : [0..4];
  [a] s=0 -> [0.1,0.3] : (s'=1) + [0.7,0.9] : (s'=2);
  [b] s=0 -> [0.2,0.8] : (s'=0) + [0.2,0.8] : (s'=4);
  [] s=1 -> 0.5 : (s'=0) + 0.5 : (s'=3);
  [] s=2 -> 0.5 : (s'=3) + 0.5 : (s'=4);
  [] s>2 -> true;
endmodule
rewards s<3 : 1; endrewards
"""
CHAIN = "dtmc module m s:[0..2]; [] s=0 -> [0.1,0.3]:(s'=1) + [0.7,0.9]:(s'=2); [] s>0 -> true; endmodule"


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "game.nm").write_text(GAME)
    (tmp_path / "chain.pm").write_text(CHAIN)


@pytest.mark.parametrize(
    "ask",
    [
        lambda m: m.matrix,
        lambda m: list(m.transitions),
        lambda m: m.successors(0),
        lambda m: m.to_networkx(),
    ],
)
def test_tables_of_transitions_are_named(ask):
    with pytest.raises(UnsupportedError, match="tables of transitions are not available") as error:
        ask(symcheck.loads(GAME))
    assert "export" in (error.value.hint or "")


@pytest.mark.parametrize(
    "formula", ["Pmaxmax=? [ X s=1 ]", "Rmaxmin=? [ C<=3 ]", "Rminmax=? [ I=3 ]"]
)
def test_strategies_that_there_are_not_are_named(formula):
    result = symcheck.loads(GAME, strategy=True).check(formula)
    with pytest.raises(NoStrategyError, match="strategies for X, C<=k and I=k are not available"):
        _ = result.strategy


@pytest.mark.parametrize(
    ("switch", "components"),
    [("sccs", [[0, 1], [3], [4]]), ("bsccs", [[3], [4]]), ("mecs", [[3], [4]])],
)
def test_components_need_no_numbers(switch, components, files, capsys):
    found = getattr(symcheck.loads(GAME), switch)
    assert [c.numbers.tolist() for c in found] == components
    assert main(["game.nm", f"-export{switch}", "out"]) == 0
    with open("out") as file:
        text = file.read()
    for component in components:
        assert "\n" + "".join(f"{i}:({i})\n" for i in component) in text


def test_files_for_matlab_hold_no_intervals(files, capsys):
    assert main(["game.nm", "-exporttrans", "out.tra", "-exportmatlab"]) == 1
    told = capsys.readouterr().err
    assert "Matlab files cannot hold intervals" in told
    assert ".tra" in told
    assert main(["game.nm", "-exportstates", "out.sta", "-exportmatlab"]) == 0


@pytest.mark.parametrize("engine", [[], ["-m"], ["-h"], ["-s"]])
def test_no_engine_draws_a_diagram(engine, files, capsys):
    assert main(["game.nm", "-exportdot", "out.dot", *engine]) == 1
    told = capsys.readouterr().err
    assert "none is kept: Markov decision processes with intervals of probabilities are" in told
    assert "hint" not in told


def test_iterations_that_are_not_told_are_no_iterations_that_there_are_not(files, capsys):
    assert main(["game.nm", "-pf", "Pmaxmax=? [ F s=3 ]", "-exportiterations", "out.csv"]) == 0
    told = capsys.readouterr().out
    assert "the method optimistic tells of its iterations only if there are many" in told
    assert "without iterations" not in told


@pytest.mark.parametrize(
    "formula", ["Pmax=? [ F s=1 ]", "Pmin=? [ G F s=1 ]", "Pmin>0.05 [ F s=1 ]"]
)
def test_fairness_has_no_effect_on_a_chain(formula, files, capsys):
    assert main(["chain.pm", "-pf", formula, "-fair"]) == 0
    told = capsys.readouterr().out
    assert "Note: -fair has no effect without an MDP" in told
    assert "Error" not in told
    fair = symcheck.loads(CHAIN, fairness=True).check(formula)
    assert fair.value == symcheck.loads(CHAIN).check(formula).value


def test_fair_strategies_of_an_mdp_are_refused():
    with pytest.raises(UnsupportedError, match="fair strategies are not available"):
        symcheck.loads(GAME, fairness=True).check("Pmaxmax=? [ F s=1 ]")
