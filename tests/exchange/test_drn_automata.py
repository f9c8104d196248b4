"""Markov automata in DRN files: what is written is read again, and what Storm writes."""

from __future__ import annotations

from pathlib import Path

import pytest

import symcheck
from symcheck.errors import UnsupportedError

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


@pytest.mark.parametrize("kind", ["tra", "umb", "dot"])
def test_other_formats_are_refused(tmp_path: Path, kind: str):
    with pytest.raises(UnsupportedError, match="cannot hold Markov automata"):
        symcheck.export(symcheck.loads(MODEL), str(tmp_path / f"m.{kind}"))


def test_storm_reads_the_file(tmp_path: Path):
    stormpy = pytest.importorskip("stormpy")
    path = tmp_path / "m.drn"
    symcheck.export(symcheck.loads(MODEL), str(path))
    built = stormpy.build_model_from_drn(str(path))
    formula = stormpy.parse_properties("Tmin=? [ F x=3 ]".replace("x=3", '"deadlock"'))[0]
    found = stormpy.model_checking(built, formula).get_value(built.initial_states[0])
    truth = symcheck.loads(MODEL).check('Tmin=? [ F "deadlock" ]')
    assert found == pytest.approx(float(truth), rel=1e-5)
