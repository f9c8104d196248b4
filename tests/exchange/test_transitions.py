"""Rewards of single transitions: each has its own, and the rows have the same expected reward as before."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from symcheck.exchange.explicit_export import explicit_export

RACE = """ctmc
module q
  n : [0..2] init 0;
  [up] n<2 -> 2 : (n'=n+1);
  [down] n>0 -> 3 : (n'=n-1);
  [reset] n>0 -> 1 : (n'=0);
endmodule
rewards "r" [up] true : 5; [down] true : 1; [reset] n=1 : 9; endrewards
"""


def test_transitions_of_a_row_have_their_own_rewards(tmp_path):
    model = symcheck.loads(RACE)
    symcheck.export(model, str(tmp_path / "m.trew"))
    # From 1 to 0: down with rate 3 for 1, reset with rate 1 for 9: together 12 at rate 4.
    assert (tmp_path / "m.trew").read_text().splitlines()[2:] == [
        "3 4",
        "0 1 5",
        "1 0 3",
        "1 2 5",
        "2 1 1",
    ]


@pytest.mark.parametrize("options", [{"engine": "sparse"}, {"engine": "mtbdd"}, {"exact": True}])
def test_every_engine_gives_the_same(options):
    found = explicit_export(symcheck.loads(RACE, **options).engine).entry_rewards(0)
    assert [float(x) for x in found] == [5, 3, 5, 0, 1]


def test_choices_of_a_dtmc_are_equally_likely():
    text = """dtmc
    module m
      s : [0..2];
      [a] s=0 -> (s'=1);
      [b] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2);
    endmodule
    rewards "r" [a] true : 6; [b] true : 3; endrewards"""
    for options in ({}, {"exact": True}):
        found = explicit_export(symcheck.loads(text, **options).engine).entry_rewards(0)
        assert [float(x) for x in found] == [5, 3, 0, 0]  # the loops of the deadlocks earn nothing


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**9), kind=st.sampled_from(["dtmc", "ctmc", "mdp"]))
def test_rows_earn_what_their_transitions_earn(seed, kind):
    shot = explicit_export(
        symcheck.loads(some_model(Random(seed), kind).text, engine="explicit").engine
    )
    for i, structure in enumerate(shot.rewards):
        total = np.add.reduceat(shot.values * shot.entry_rewards(i), shot.matrix.indptr[:-1])
        assert total == pytest.approx(structure.rows, rel=1e-12, abs=1e-15)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**9), kind=st.sampled_from(["dtmc", "ctmc"]))
def test_rational_arithmetic_agrees(seed, kind):
    text = some_model(Random(seed), kind).text
    doubles, rationals = (
        explicit_export(symcheck.loads(text, **options).engine)
        for options in ({"engine": "explicit"}, {"exact": True})
    )
    for i in range(len(doubles.rewards)):
        assert doubles.entry_rewards(i) == pytest.approx(
            [float(x) for x in rationals.entry_rewards(i)], rel=1e-12
        )


@pytest.mark.parametrize("exact", [False, True])
def test_what_is_read_is_written_again(exact, tmp_path):
    symcheck.export(symcheck.loads(RACE), str(tmp_path / "m.tra,trew"))
    again = symcheck.load_explicit(str(tmp_path / "m.tra,trew"), exact=exact)
    symcheck.export(again, str(tmp_path / "n.trew"))
    assert (tmp_path / "n.trew").read_text() == (tmp_path / "m.trew").read_text()


def test_measures_see_the_expected_reward_of_what_was_read(tmp_path):
    (tmp_path / "m.tra").write_text("3 4\n0 1 0.25\n0 2 0.75\n1 1 1\n2 2 1\n")
    (tmp_path / "m.trew").write_text("3 2\n0 1 8\n0 2 4\n")
    model = symcheck.load_explicit(str(tmp_path / "m.tra,trew"))
    assert model.check("R=? [ F x>0 ]").value == 0.25 * 8 + 0.75 * 4


def test_the_loop_of_a_deadlock_earns_nothing(tmp_path):
    (tmp_path / "m.tra").write_text("3 2\n0 1 0.5\n0 2 0.5\n")
    (tmp_path / "m.trew").write_text("3 1\n0 2 4\n")
    model = symcheck.load_explicit(
        str(tmp_path / "m.tra,trew"),
        type=symcheck.loads("dtmc module m x:bool; endmodule").program.type,
    )
    assert explicit_export(model.engine).entry_rewards(0).tolist() == [0, 4, 0, 0]
