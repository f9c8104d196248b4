"""The cone of influence on the command line: the counts are those of the whole model."""

from __future__ import annotations

import re

import pytest

from symcheck.cli import main

MODEL = """mdp
module walker
  x : [0..99];
  [tick] x<99 -> 0.5:(x'=x+1) + 0.5:true;
  [jump] x>0 & x<99 -> 0.25:(x'=x-1) + 0.75:true;
  [tick] x=99 -> true;
endmodule
module timer
  t : [0..9999];
  [tick] t<9999 -> (t'=t+1);
  [tick] t=9999 -> true;
endmodule
label "end" = x=99;
rewards "ticks" [tick] x<99 : 1; endrewards
"""


@pytest.fixture
def run(tmp_path, capsys):
    """Check the model with some switches; what is printed."""
    file = tmp_path / "timed.pm"
    file.write_text(MODEL)

    def run(*switches: str) -> str:
        assert main([str(file), *switches]) == 0
        return capsys.readouterr().out

    return run


def counts(out: str) -> list[str]:
    return re.findall(r"^(?:States|Transitions|Choices): .*", out, re.MULTILINE)


def test_a_variable_that_does_not_matter_is_left_out(run):
    out = run("-pf", 'Rmin=? [ F "end" ]')
    whole = run("-pf", 'Rmin=? [ F "end" ]', "-nosymmetry")
    assert (
        "Ignored:     t (no property depends on it)\n  checked on 100 states and 395 transitions\n"
        in out
    )
    assert "Ignored:" not in whole
    assert len(counts(out)) == 3
    assert counts(out) == counts(whole)
    results = [float(re.search(r"Result: (\S+)", o)[1]) for o in (out, whole)]
    assert results == pytest.approx([198, 198])


def test_it_is_not_left_out_where_it_is_asked_for(run):
    assert "Ignored:" not in run("-pf", 'Pmin=? [ F "end" & t<9999 ]')


@pytest.mark.parametrize("switch", ["-exportlabels", "-exportstrat"])
def test_it_is_not_left_out_where_states_are_written(run, tmp_path, switch):
    file = tmp_path / "states.txt"
    assert "Ignored:" not in run("-pf", 'Rmin=? [ F "end" ]', switch, str(file))


def test_symmetry_that_has_no_effect_is_explained(run):
    assert "no modules are equal" in run("-pf", 'Rmin=? [ F "end" ]', "-symmetry")
