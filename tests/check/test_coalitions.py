"""Coalitions on MDPs: the one player takes part, and strategies are sought, or not."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import InputError

MODEL = """
mdp
module m
  s : [0..2] init 0;
  [a] s=0 -> 0.5:(s'=1) + 0.5:(s'=2);
  [b] s=0 -> 0.25:(s'=1) + 0.75:(s'=2);
  [] s>0 -> true;
endmodule
rewards "r" [a] true : 1; [b] true : 3; endrewards
"""


@pytest.mark.parametrize("bound", ["P>=0.3 [ F s=1 ]", "P<=0.3 [ F s=1 ]", 'R{"r"}<=2 [ F s>0 ]'])
@pytest.mark.parametrize(
    ("coalition", "exists"),
    [("<<*>>", True), ("<< * >>", True), ("[[]]", True), ("<<>>", False), ("[[*]]", False)],
)
def test_a_bound_holds_under_some_or_all_strategies(bound: str, coalition: str, exists: bool):
    """Of two strategies, one satisfies each of the bounds."""
    model = symcheck.loads(MODEL)
    assert model.check(f"{coalition} {bound}").value is exists
    assert model.check(f"filter(forall, s>0 | {coalition} {bound})").value is exists


@pytest.mark.parametrize("coalition", ["<<*>>", "<<>>", "[[*]]", "[[]]"])
def test_queries_name_their_direction(coalition: str):
    model = symcheck.loads(MODEL)
    assert float(model.check(f"{coalition} Pmax=? [ F s=1 ]")) == 0.5
    assert float(model.check(f"{coalition} Pmin=? [ F s=1 ]")) == 0.25


@pytest.mark.parametrize("named", ["<<1>>", "<<a,b>>", "[[p]]"])
def test_named_players_are_refused(named: str):
    with pytest.raises(InputError, match="named players belong to stochastic games"):
        symcheck.loads(MODEL).check(f"{named} P>=0.3 [ F s=1 ]")


def test_brackets_that_meet_are_no_coalition():
    model = symcheck.loads(MODEL)
    assert model.check("P>=1 [ F P>=1 [ X s>0]]").value is True
    assert float(model.check("Pmax=? [[[*]]P>=1 [ X s=s] U s=1 ]")) == 0.5
