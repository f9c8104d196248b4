"""Words of the command line and of warnings that were misleading."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import NameFault

MODEL = """dtmc
module m
  s : [0..2];
  [] s=0 -> 0.5:(s'=0) + 0.25:(s'=1) + 0.25:(s'=2);
  [] s>0 -> true;
endmodule
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "m.pm").write_text(MODEL)
    return str(tmp_path / "m.pm")


@pytest.mark.parametrize("words", [("-pf", "P=?", "[", "F", "s=1", "]"), ("P=?", "[", "F", "s=1")])
def test_a_property_that_the_shell_has_split_is_quoted(path, capsys, words):
    assert main([path, *words]) == 2
    assert "hint: quote a property: -pf 'P=? [ F s=1" in capsys.readouterr().err


def test_an_older_filter_has_a_name(path, capsys):
    assert main([path, "-pf", "P=? [ F s=1 {s=0} ]"]) == 0
    assert "(filter 'state')" in capsys.readouterr().out


@pytest.mark.parametrize("engine", ["-ex", "-s", "-h", "-m", "-exact"])
def test_one_state_is_singular(path, capsys, engine):
    assert main([path, engine, "-v", "-pf", "P=? [ F s=1 ]"]) == 0
    out = capsys.readouterr().out
    assert "1 state" in out
    assert "1 states" not in out


def test_relative_distances_of_bounds_say_so():
    text = """mdp module m s:[0..3]; [] s=0 -> 1e-9:(s'=1) + 1-1e-9:true;
      [] s=1 -> 0.1:(s'=2) + 0.5:(s'=3) + 0.4:(s'=0); [] s>=2 -> true; endmodule"""
    for relative in (True, False):
        model = symcheck.loads(text, method="interval", max_iterations=5, relative=relative)
        (warning,) = model.check("Pmax=? [ F s=2 ]").warnings
        assert ("apart, relative to their value, further" in warning) is relative


def test_a_constant_that_nothing_declares():
    model = symcheck.loads(MODEL)
    with pytest.raises(NameFault, match="hint: declare it there: const int k;"):
        model.check("P=? [ F<=k s=1 ]", constants={"k": 3})
    with pytest.raises(NameFault, match="hint: declare it there: const double p;"):
        assert symcheck.loads(MODEL, constants={"p": 0.5}).bound
    assert model.check("const int k; P=? [ F<=k s=1 ]", constants={"k": 0}).value == 0
