"""Exploration that stops where the properties are decided: fewer states, the same values."""

from __future__ import annotations

from random import Random

import pytest

import symcheck
from generate import random_model
from symcheck.cli import main
from symcheck.options import EngineName

WALK = """const int N = 9; module m x : [0..N] init 3; y : bool;
  [] x>0 & x<N -> 1/3 : (x'=x+1) + 2/3 : (x'=x-1); [] x=0 -> (y'=!y);
  [] x=N -> (x'=0); endmodule
label "top" = x=N; rewards true : 1; endrewards rewards "steps" [] true : 1; endrewards"""


def explored(text: str, formula: str, **options: object) -> int | None:
    """The number of states that are explored for a property; None: all of them."""
    model = symcheck.loads(text, stop_at_targets=True, **options)  # type: ignore[arg-type]
    file = symcheck.parse_properties(formula)
    reduced = model.reduced_for(model.instances(file, {}))
    return reduced.engine.states if reduced.smaller else None


@pytest.mark.parametrize(
    ("formula", "states"),
    [
        ("P=? [ F x=2 ]", 10),  # 2 to 9, and two states with x=0 behind 9
        ("P=? [ F<=4 x=2 | x=5 ]", 4),
        ("P=? [ x<5 U x=1 ]", 5),
        ("P=? [ x<5 U<=3 x=1 ]", 5),
        ("P=? [ G x>1 & x<6 ]", 6),
        ("P=? [ x>1 W x=6 ]", 6),
        ("P=? [ F[0,4] x=2 | x=5 ]", 4),
        ("P>=0.5 [ F x=3 ]", 1),
        ('P<0.1 [ F "top" | x=2 ]', 8),
        ("R=? [ F x=2 | x=4 ]", 3),
        ('R{"steps"}=? [ F x=2 | x=4 ]', 3),
        ("T=? [ F x=2 | x=4 ]", 3),
        ("P=? [ F x=2 | x=6 ]; P=? [ F x=2 | x>4 ]", 5),
        ("P=? [ F>1 x=2 ]", None),
        ("P=? [ F[2,3] x=2 ]", None),
        ("P=? [ X x=2 ]", None),
        ("P=? [ F G x=2 ]", None),
        ("P=? [ F (x=2 & X x=3) ]", None),
        ("R=? [ F (x=2 & X x=3) ]", None),
        ("P=? [ F P>0.5 [ X x=2 ] ]", None),
        ('P=? [ F "deadlock" ]', None),
        ('P=? [ F "init" ]', None),
        ("R=? [ C<=5 ]", None),
        ("S=? [ x=2 ]", None),
        ("filter(max, P=? [ F x=2 ], true)", None),
        ("P=? [ F x=2 ] + 1", None),
        ("P=? [ F x=2 ]; S=? [ x=2 ]", None),
    ],
)
def test_states_that_are_explored(formula: str, states: int | None) -> None:
    assert explored(f"dtmc {WALK}", formula, engine="explicit") == states
    assert explored(f"ctmc {WALK}", formula, engine="hybrid") == states


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "exact"])
@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_values_are_those_of_the_whole_model(kind: str, engine: EngineName) -> None:
    rng = Random(f"{kind} {engine}")
    opt = "max" if kind == "mdp" else ""
    smaller = 0
    for _ in range(4):
        generated = random_model(rng, kind)
        text = generated.text.replace("[go] true", "[] true")  # no command may have the action
        (x, _), (y, _) = (rng.choice(generated.variables) for _ in range(2))
        target, kept = f"{x}=1", f"{y}<=2"
        bound = "<=3" if kind != "ctmc" or engine != "exact" else ""
        for formula in (
            f"P{opt}=? [ F {target} ]",
            f"P{opt}=? [ {kept} U{bound} {target} ]",
            f"P{opt and 'min'}=? [ G{bound} {kept} ]",
            f"P{opt}>=0.5 [ {kept} U {target} ]",
            f"R{opt and 'min'}=? [ F {target} ]",
        ):
            whole = symcheck.loads(text, engine=engine)
            part = whole.with_options(stop_at_targets=True, reduce=rng.random() < 0.5)
            expected, value = whole.check(formula).value, part.check(formula).value
            assert value == pytest.approx(expected, rel=1e-5), (text, formula)
            file = symcheck.parse_properties(formula)
            reduced = part.reduced_for(part.instances(file, {}))
            smaller += reduced.engine.states < whole.engine.states
    assert smaller


def test_thresholds_are_decided_by_rationals_on_the_part() -> None:
    die = symcheck.load("models/die/die.pm", stop_at_targets=True)
    assert die.check("P>=1/6 [ F s=7 & d=6 ]").value is True
    assert die.check("P>1/6 [ F s=7 & d=6 ]").value is False
    assert die.with_options(reduce=True).check("P>1/6 [ F s=7 & d=6 ]").value is False


@pytest.mark.parametrize("options", [{"everywhere": True}, {"strategy": True}, {"fairness": True}])
def test_all_states_are_explored_where_they_are_asked_for(options: dict[str, bool]) -> None:
    assert explored(f"mdp {WALK}", "Pmax=? [ F x=2 ]", **options) is None


def test_the_output_says_that_states_are_a_part(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["models/die/die.pm", "-nostates", "-pf", "P=? [ F s=1 | s=2 ]"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "States:      3 (1 initial; only those that the properties need)" in out
    for further in (["-pf", "S=? [ s=7 ]"], ["-exportstates", "stdout"], ["-steadystate"]):
        assert main([*words, *further]) == 0
        out = capsys.readouterr().out
        assert "States:      13 (1 initial)\n" in out
        assert "Note: -nostates has no effect" in out
