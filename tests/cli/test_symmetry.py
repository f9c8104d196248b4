"""Symmetry on the command line: used without being asked for, and never where states are shown."""

from __future__ import annotations

import re

import pytest

from symcheck.cli import main

COPIES = 6
MODEL = f"""dtmc
module p1
  x1 : [0..6];
  [] x1<6 -> 0.5:(x1'=x1+1) + 0.5:(x1'=0);
  [] x1=6 -> true;
endmodule
{"".join(f"module p{i} = p1 [x1=x{i}] endmodule " for i in range(2, COPIES + 1))}
label "all" = {"&".join(f"x{i}=6" for i in range(1, COPIES + 1))};
"""
STATES = 7**COPIES
ORBITS = 924  # multisets of 6 of 7 values


@pytest.fixture
def run(tmp_path, capsys):
    """Check the model with some switches; the exit status and what is printed."""
    file = tmp_path / "copies.pm"
    file.write_text(MODEL)

    def run(*switches: str) -> tuple[int, str]:
        status = main([str(file), *switches])
        return status, capsys.readouterr().out

    return run


def value(out: str) -> float:
    return float(re.search(r"Result: (\S+)", out)[1])


def test_a_large_model_of_copies_is_explored_up_to_symmetry(run):
    status, out = run("-pf", 'P=? [ F<=50 "all" ]')
    assert status == 0
    assert f"States:      {STATES} (1 initial)" in out
    assert "Symmetry:    all permutations of p1, …, p6" in out
    assert f"  checked on {ORBITS} states" in out
    _, whole = run("-pf", 'P=? [ F<=50 "all" ]', "-nosymmetry")
    assert "Symmetry" not in whole
    assert f"States:      {STATES} (1 initial)" in whole
    assert re.findall(r"Transitions: \d+", out) == re.findall(r"Transitions: \d+", whole)
    assert value(out) == pytest.approx(value(whole), rel=1e-6)


@pytest.mark.parametrize(
    "switches",
    [
        ("-pf", "P=? [ F<=50 x1=6&x2=5&x3=4&x4=3&x5=2&x6=1 ]"),
        ("-pf", 'filter(count, P>0.1 [ F<=9 "all" ])'),
        ("-pf", 'P=? [ F<=50 "all" ]', "-exportlabels", "stdout"),
        ("-pf", 'P=? [ F<=50 "all" ]', "-s"),
        (),
    ],
)
def test_what_shows_states_has_all_of_them(run, switches: tuple[str, ...]):
    status, out = run(*switches)
    assert status == 0
    assert "Symmetry" not in out
    assert f"States:      {STATES} (1 initial)" in out


def test_a_request_that_cannot_be_honoured_is_told(run):
    _, out = run("-pf", 'P=? [ F<=5 "all" ]', "-symmetry", "-exportlabels", "stdout")
    assert "-symmetry is not used" in out


@pytest.mark.parametrize(
    ("switches", "reason"),
    [
        (
            ("-m", "-pf", 'P=? [ F<=5 "all" ]'),
            "the engine mtbdd has no symmetry reduction, -ex has",
        ),
        (("-ex", "-pf", "P=? [ F<=5 x1=6 & x2=5 & x3=4 & x4=3 & x5=2 & x6=1 ]"), "tell them apart"),
        (("-ex", "-pf", 'P=? [ F<=5 "all" ]', "-fair"), "values at initial states alone"),
    ],
)
def test_a_request_without_effect_is_noted(run, switches: tuple[str, ...], reason: str):
    _, out = run("-symmetry", *switches)
    note = next(line for line in out.splitlines() if line.startswith("Note: -symmetry"))
    assert note.endswith(reason)


def test_a_small_model_is_explored_as_it_is_unless_the_engine_is_named(tmp_path, capsys):
    file = tmp_path / "small.pm"
    file.write_text(MODEL.replace("[0..6]", "[0..2]").replace("=6", "=2").replace("x1<6", "x1<2"))
    words = [str(file), "-symmetry", "-pf", 'P=? [ F<=5 "all" ]']
    main(words)
    assert (
        "-symmetry has no effect: the default engine uses it for large" in capsys.readouterr().out
    )
    main([*words, "-ex"])
    out = capsys.readouterr().out
    assert "Symmetry:" in out
    assert "no effect" not in out


def test_the_explicit_engine_uses_symmetry_if_asked(run):
    _, out = run("-ex", "-symmetry", "-pf", 'P=? [ F<=50 "all" ]')
    assert f"  checked on {ORBITS} states" in out
