"""Distributions in rational arithmetic, against elimination with fractions written here."""

from __future__ import annotations

from fractions import Fraction
from math import exp

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import UsageError

CHAIN = """
{type}
module m
  s : [0..5] init 0;
  [] s=0 -> 1/3:(s'=1) + 2/3:(s'=3);
  [] s=1 -> 0.1:(s'=1) + 0.9:(s'=2);
  [] s=2 -> 1/7:(s'=1) + 6/7:(s'=2);
  [] s=3 -> 1:(s'=4);
  [] s=4 -> 0.3:(s'=3) + 0.7:(s'=5);
  [] s=5 -> 1:(s'=3);
endmodule
"""
THIRD = Fraction(1, 3)
ROWS = [
    [0, THIRD, 0, 2 * THIRD, 0, 0],
    [0, Fraction(1, 10), Fraction(9, 10), 0, 0, 0],
    [0, Fraction(1, 7), Fraction(6, 7), 0, 0, 0],
    [0, 0, 0, 0, 1, 0],
    [0, 0, 0, Fraction(3, 10), 0, Fraction(7, 10)],
    [0, 0, 0, 1, 0, 0],
]


def step(x):
    return [sum(x[i] * ROWS[i][j] for i in range(6)) for j in range(6)]


def test_steps_are_products_of_fractions():
    model = symcheck.loads(CHAIN.format(type="dtmc"), exact=True)
    x = [Fraction(1), *[Fraction(0)] * 5]
    for k in range(12):
        found = model.transient(k)
        assert found.exact
        assert found.error == 0
        assert list(found.values) == x
        x = step(x)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc"])
def test_the_long_run_distribution_satisfies_its_equations(kind):
    """pi P = pi holds exactly, and each component has the probability of reaching it."""
    found = symcheck.loads(CHAIN.format(type=kind), exact=True).steady_state()
    pi = list(found.values)
    assert found.exact
    assert sum(pi) == 1
    assert pi[0] == 0
    assert pi[1] + pi[2] == THIRD
    assert step(pi) == pi  # all rates of the chain in continuous time sum to 1


def test_another_initial_distribution_is_read_as_decimals():
    model = symcheck.loads(CHAIN.format(type="dtmc"), exact=True)
    start = [Fraction(1, 10), Fraction(2, 10), Fraction(7, 10), 0, 0, 0]
    found = model.transient(1, [0.1, 0.2, 0.7, 0, 0, 0])
    assert list(found.values) == step(start)
    assert list(model.steady_state([0.1, 0.2, 0.7, 0, 0, 0]).values)[3:] != [0, 0, 0]
    with pytest.raises(UsageError, match="sum to 1"):
        model.transient(1, [0.1, 0.2, 0.699999999999, 0, 0, 0])


def test_times_of_a_ctmc_have_bounds(tmp_path, capsys):
    """They are no rational numbers, and a note says so."""
    model = symcheck.loads(CHAIN.format(type="ctmc"), exact=True)
    assert list(model.transient(0).values) == [1, 0, 0, 0, 0, 0]
    found = model.transient(0.5)
    assert not found.exact
    assert found.lower[0] <= exp(-0.5) <= found.upper[0]
    (tmp_path / "m.sm").write_text(CHAIN.format(type="ctmc"))
    assert main([str(tmp_path / "m.sm"), "-exact", "-transient", "0.5"]) == 0
    assert "Note: -exact has no effect on transient probabilities" in capsys.readouterr().out


def test_the_command_line_prints_fractions(tmp_path, capsys):
    (tmp_path / "m.pm").write_text(CHAIN.format(type="dtmc"))
    assert main([str(tmp_path / "m.pm"), "-exact", "-transient", "1", "-steadystate"]) == 0
    out = capsys.readouterr().out
    assert "1:(1)=1/3\n" in out
    assert "Accuracy: each probability is exact (1 steps in rational arithmetic)" not in out
    assert "Accuracy: each probability is exact (1 step in rational arithmetic)" in out
    assert "2 bottom components; rational elimination" in out


def test_a_time_may_be_a_fraction(tmp_path, capsys):
    (tmp_path / "m.sm").write_text(CHAIN.format(type="ctmc"))
    assert main([str(tmp_path / "m.sm"), "-transient", "1/2"]) == 0
    assert "(time = 1/2)" in capsys.readouterr().out


@pytest.mark.parametrize("engine", ["-ex", "-exact"])
def test_an_order_of_diagrams_is_noted_where_there_are_none(tmp_path, capsys, engine):
    (tmp_path / "m.pm").write_text(CHAIN.format(type="dtmc"))
    assert main([str(tmp_path / "m.pm"), engine, "-order", "force", "-pf", "s=0"]) == 0
    assert "Note: -order has no effect" in capsys.readouterr().out


def test_an_mdp_has_bounds_instead(tmp_path, capsys):
    (tmp_path / "m.nm").write_text("mdp module m s:[0..1]; [] true -> (s'=1); endmodule")
    assert main([str(tmp_path / "m.nm"), "-transient", "3"]) == 1
    err = capsys.readouterr().err
    assert "an MDP has no transient distribution over its states: it depends on the strategy" in err
    assert "hint: Pmin=? [ F=10 x=1 ]" in err
    assert main([str(tmp_path / "m.nm"), "-steadystate"]) == 1
    assert "hint: Smin=? [ x=1 ]" in capsys.readouterr().err
