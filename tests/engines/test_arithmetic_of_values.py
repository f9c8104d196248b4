"""Arithmetic between values of formulas and expressions over states, on each engine."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.options import ENGINES

MODEL = """dtmc
module m
  x : [0..3];
  [] x=0 -> 0.5:(x'=1) + 0.25:(x'=2) + 0.25:(x'=3);
  [] x>0 -> true;
endmodule
"""
HALF = "P=? [ F x=1 ]"


RATIONAL = [
    (f"(2 * {HALF})^(x + 3)", 1),
    (f"({HALF})^(x + 2)", Fraction(1, 4)),
    (f"mod(x + 7, 2) + {HALF}", Fraction(3, 2)),
    (f"min({HALF}, x + 1) / (x + 2)", Fraction(1, 4)),
]
IRRATIONAL = [(f"pow(x + 4, {HALF})", 2), (f"log({HALF} * 4, x + 2)", 1)]  # in general


@pytest.mark.parametrize(
    ("engine", "expression", "value"),
    [
        *((engine, *case) for engine in ENGINES for case in RATIONAL),
        *((engine, *case) for engine in ENGINES if engine != "exact" for case in IRRATIONAL),
    ],
)
def test_a_value_is_combined_with_an_expression_over_states(engine, expression, value):
    result = symcheck.loads(MODEL, engine=engine).check(expression)
    assert float(result.value) == pytest.approx(float(value), abs=1e-6)
