"""Long-run averages of chains."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.numerics import tuning

QUEUE = """ctmc
module queue
  n : [0..60];
  [] n<60 -> 1 : (n'=n+1);
  [] n>0 -> 4 : (n'=n-1);
endmodule
rewards "balance" n=0 : -1; n=1 : 4; endrewards
"""
"""State n has (1/4)^n times the probability of state 0."""


def test_a_rare_state_of_a_large_chain_has_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bounds from the Poisson equation are absolute, and too wide for 1e-36."""
    model = symcheck.loads(QUEUE)
    exact = Fraction(3, 4) / 4**60 / (1 - Fraction(1, 4**61))
    found = model.check("S=? [ n=60 ]")
    assert found.value == pytest.approx(float(exact), rel=1e-9)
    assert not found.warnings
    for name in ("SMALL_CHAIN_STATES", "ELIMINATION_STATES"):
        monkeypatch.setattr(tuning, name, 0)
    wide = symcheck.loads(QUEUE).check("S=? [ n=60 ]")
    low, high = wide.bounds
    assert low <= exact <= high
    assert "further than asked for" in wide.warnings[0]


def test_an_average_of_0_has_none() -> None:
    found = symcheck.loads(QUEUE).check('R{"balance"}=? [ S ]')
    assert found.value == pytest.approx(0.0, abs=1e-12)
    assert not found.warnings
