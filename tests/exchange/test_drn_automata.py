"""Markov automata in DRN files: what is written is read again, and what Storm writes."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import symcheck
from symcheck.errors import SyntaxFault, UnsupportedError
from symcheck.syntax.ast import ModelType

MODEL = """
ma
module m
  x : [0..3];
  <> x=0 -> 2:(x'=1) + 1:(x'=2);
  <> x=1 -> 3:(x'=2);
  [b] x=2 -> 0.5:(x'=3) + 0.5:(x'=0);
  [c] x=2 -> (x'=1);
endmodule
rewards x=0:3; [b] true:7; x=2:11; endrewards
"""

HYBRID = """@type: Markov Automaton
@parameters

@reward_models

@nr_states
2
@nr_choices
3
@model
state 0 !5 init
\taction __NOLABEL__
\t\t0 : 1
\taction go
\t\t1 : 1
state 1 !1
\taction __NOLABEL__
\t\t1 : 1
"""
"""A state with a rate and a choice: no time passes there."""

FORMULAS = ("Tmin=? [ F x=3 ]", "Rmax=? [ F x=3 ]", "Pmax=? [ F<=1 x=3 ]", "Pmin=? [ F<=1 x=3 ]")


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "mtbdd"])
def test_a_file_holds_the_whole_model(tmp_path: Path, engine: str):
    model = symcheck.loads(MODEL)
    path = tmp_path / "m.drn"
    symcheck.export(model, str(path))
    text = path.read_text()
    assert "@type: Markov Automaton" in text
    assert "state 0 !3" in text
    assert "state 2 !0" in text
    again = symcheck.load_explicit(str(path), engine=engine)
    for formula in FORMULAS:
        assert float(again.check(formula)) == pytest.approx(float(model.check(formula)), rel=1e-6)


def test_time_does_not_pass_in_a_state_with_a_choice(tmp_path: Path):
    path = tmp_path / "m.drn"
    path.write_text(HYBRID)
    model = symcheck.load_explicit(str(path))
    assert model.check("Pmax=? [ F<=0 x=1 ]").value == 1
    assert model.check("Tmax=? [ F x=1 ]").value == 0


@pytest.mark.parametrize("kind", ["tra", "trew", "umb", "umbt", "dot", "pexp", "all", "m"])
def test_other_formats_are_refused(tmp_path: Path, kind: str):
    with pytest.raises(UnsupportedError, match="cannot hold Markov automata"):
        symcheck.export(symcheck.loads(MODEL), str(tmp_path / f"m.{kind}"))
    assert not list(tmp_path.iterdir())


def test_a_file_that_lacks_the_rates_is_not_read(tmp_path: Path):
    (tmp_path / "m.tra").write_text("# Transitions (MA)\n2 2 2\n0 0 1 3\n1 0 1 1\n")
    with pytest.raises(SyntaxFault, match=r"(?s)m\.tra:2:1.*calls this a MA.*DRN files hold"):
        _ = symcheck.load_explicit(str(tmp_path / "m.tra")).engine


def test_storm_reads_the_file(tmp_path: Path):
    stormpy = pytest.importorskip("stormpy")
    path = tmp_path / "m.drn"
    symcheck.export(symcheck.loads(MODEL), str(path))
    built = stormpy.build_model_from_drn(str(path))
    formula = stormpy.parse_properties("Tmin=? [ F x=3 ]".replace("x=3", '"deadlock"'))[0]
    found = stormpy.model_checking(built, formula).get_value(built.initial_states[0])
    truth = symcheck.loads(MODEL).check('Tmin=? [ F "deadlock" ]')
    assert found == pytest.approx(float(truth), rel=1e-5)


RACES = """@type: Markov Automaton
@reward_models
r
@nr_states
4
@model
state 0 !5 [2] init
\taction 0 [3]
\t\t1 : 0.4
\t\t2 : 0.6
state 1 !1/2 [1]
\taction 0 [0]
\t\t0 : 1/4
\t\t2 : 3/4
state 2 [0] end
state 3 !4 [0]
\taction 0 [7]
\t\t2 : 1
"""
ASKED = (
    *('P{}=? [ F<=1/2 "end" ]', "P{}=? [ F<=2 x=1 ]", 'T{}=? [ F "end" ]', 'R{}=? [ F "end" ]'),
    *("R{}=? [ C<=1 ]", "S{}=? [ x=1 ]", "R{}=? [ S ]"),
)


def test_a_file_in_which_nothing_is_left_to_choose_is_a_ctmc(tmp_path: Path):
    (tmp_path / "m.drn").write_text(RACES)
    chain = symcheck.load_explicit(str(tmp_path / "m.drn"))
    assert chain.type is ModelType.CTMC
    assert chain.transient(0.5).values.sum() == pytest.approx(1)
    choice = "\taction 1 [0]\n\t\t2 : 1\n"  # in a state that is not reached
    (tmp_path / "n.drn").write_text(RACES.replace("state 3 !4", "state 3") + choice)
    automaton = symcheck.load_explicit(str(tmp_path / "n.drn"))
    assert automaton.type is ModelType.MA
    for asked in ASKED:
        expected = float(automaton.check(asked.format("max")))
        assert float(chain.check(asked.format(""))) == pytest.approx(expected, rel=1e-6), asked


@pytest.mark.parametrize("exact", [False, True])
def test_a_function_in_which_nothing_is_left_to_choose_is_a_ctmc(exact):
    def step(x):
        return {1: Fraction(2), 2: 3} if x == 0 else {0: 1, 2: Fraction(1, 2)} if x == 1 else None

    rewards = {"r": (lambda x: x + 1, lambda x, _, y: x + 2 * y)}
    labels = {"end": lambda x: x == 2}
    first, second = (
        symcheck.from_function(0, step, type=kind, rewards=rewards, labels=labels, exact=exact)
        for kind in ("ma", "ctmc")
    )
    assert first.type is ModelType.CTMC
    for asked in ASKED if not exact else ('T{}=? [ F "end" ]', 'R{}=? [ F "end" ]'):
        asked = asked.format("").replace("x", "s")
        assert first.check(asked).value == second.check(asked).value
