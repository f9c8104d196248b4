"""Nobody is told to use -exact where it refuses: time bounds in continuous time."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import NumericalError, UnsupportedError

AUTOMATON = """ma
module m
  x : [0..2];
  [a] x=0 -> (x'=1); [b] x=0 -> (x'=2);
  <> x>0 -> 1 : (x'=0);
endmodule
rewards x=1 : 1; x=1 : -2; x=2 : -2; endrewards
"""
CHAIN = "ctmc module m x:[0..1]; [] x=0 -> 1:(x'=1); endmodule"
WORKER = """ma module m x:[0..3];
  [a] x=0 -> (x'=1); [b] x=0 -> (x'=2); <> x=1 -> 10 : (x'=3); <> x=2 -> 1 : (x'=3);
endmodule"""
CLOSE = 0.6321205588285577  # 1 - 1/e, as a double


@pytest.mark.parametrize(
    ("text", "formula", "called"),
    [
        (CHAIN, f"P>={CLOSE} [ F<=1 x=1 ]", "a CTMC"),
        (WORKER, f"Pmin>={CLOSE} [ F<=1 x=3 ]", "Markov automata"),
    ],
)
def test_a_threshold_that_nothing_decides_has_no_hint_at_exact(text, formula, called):
    with pytest.raises(NumericalError, match="cannot decide") as error:
        symcheck.loads(text).check(formula)
    assert error.value.hint == "=? in place of the bound gives the value with its accuracy"
    assert "exact" not in str(error.value)
    message = f"time-bounded properties of {called} have no rational values"
    with pytest.raises(UnsupportedError, match=message) as refused:
        symcheck.loads(text, exact=True).check(formula)
    assert refused.value.hint == "check them without -exact"


def test_rewards_of_both_signs_have_the_hint_where_it_helps():
    model = symcheck.loads(AUTOMATON)
    with pytest.raises(UnsupportedError, match="rewards of both signs") as error:
        model.check("Rmax=? [ C<=1 ]")
    assert error.value.hint is None
    with pytest.raises(UnsupportedError, match="rewards of both signs") as error:
        model.check("Rmax=? [ S ]")
    assert error.value.hint == "use -exact"
    assert model.with_options(exact=True).check("Rmax=? [ S ]").value == -1
