"""Components that are left with a probability near the rounding error."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import symcheck
from symcheck.kernels.solve.certificates import certify
from symcheck.numerics import tuning

SELDOM_LEFT = """dtmc
module a
  x : [0..1] init 1;
  z : [0..1];
  [go] true -> 0.2 : (z'=1) + 0.3 : (x'=1-x) + 0.5 : (z'=0);
  [] x=1 -> 1/3 : (z'=0) + 2/3 : (x'=1);
  [] y!=0 -> 0.25 : (x'=0) + 0.75 : (z'=1);
  [] true -> 0.5 : (x'=0) + 0.5 : (z'=1);
  [] true -> 1/3 : (x'=1) + 2/3 : (x'=0);
endmodule
module b
  y : [0..1] init 1;
  w : [0..2] init 1;
  [go] w!=0 -> 1e-12 : (w'=mod(w+1,3)) + 0.5 : (w'=1) + 0.5-1e-12 : (w'=1);
  [go] x=0 -> (y'=1);
endmodule
rewards "r" w!=2 : 2; [go] true : 0.5; endrewards
"""


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid"])
def test_a_component_that_is_seldom_left(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """BiCGStab finds solutions and weights that are wrong, and the proof must fail."""
    formula = 'R{"r"}=? [ S ]'
    exact = symcheck.loads(SELDOM_LEFT, exact=True).check(formula).value
    monkeypatch.setattr(tuning, "SMALL_COMPONENT_STATES", 1)
    monkeypatch.setattr(tuning, "EARLY_OPERATIONS_PER_ENTRY", 0)
    low, high = symcheck.loads(SELDOM_LEFT, engine=engine).check(formula).bounds
    assert isinstance(exact, Fraction)
    assert low <= exact <= high
    assert high - low <= 1e-6 * exact


def test_a_weight_that_is_not_positive_proves_nothing() -> None:
    """X = 1/2 x + 1 has the solution 2."""
    indptr, indices = np.array([0, 1]), np.zeros(1, np.int32)
    half, one, policy = np.array([0.5]), np.ones(1), np.zeros(1, np.int64)
    for x in (1.0, 3.0):
        for weight in (1.0, 0.0, -1.0):
            low, high = certify(
                indptr,
                indices,
                half,
                None,
                one,
                one,
                np.array([x]),
                np.array([weight]),
                policy,
                0,
                0.0,
            )
            if weight > 0.0:
                assert x - low * weight <= 2.0 <= x + high * weight
                assert low + high == pytest.approx(1.0)
            else:
                assert low == high == np.inf
