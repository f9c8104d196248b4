"""Arithmetic between values of formulas and expressions over states, on each engine."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

import symcheck
from symcheck.errors import ModelFault
from symcheck.options import ENGINES
from symcheck.semantics.expressions.evaluate import evaluate_closely
from symcheck.syntax.operators import Signature
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.printer import pretty
from syntax.operations import NUMERIC, applied

MODEL = """dtmc
module m
  x : [0..3];
  [] x=0 -> 0.5:(x'=1) + 0.25:(x'=2) + 0.25:(x'=3);
  [] x>0 -> true;
endmodule
"""
HALF = "(P=? [ F x=1 ])"
APPLICATIONS = [
    (o, n) for o, n in NUMERIC if o.signature not in (Signature.ORDER, Signature.EQUALITY)
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("operation", "count"), APPLICATIONS)
def test_a_value_is_combined_with_an_expression_over_states(engine, operation, count):
    """Every operator and function has the value that it has for numbers."""
    model = symcheck.loads(MODEL, engine=engine)
    value = "floor(7 * p)" if operation.signature is Signature.INTEGER else "3 * p / 2"
    operands = [value, "x + 2", "4 - x"]
    for parts in (operands, operands[1::-1] + operands[2:]):
        text = pretty(applied(operation, *map(parse_expression, parts[:count])))
        expected = evaluate_closely(parse_expression(text), {"x": 0, "p": Fraction(1, 2)})
        try:
            found = model.check(re.sub(r"\bp\b", HALF, text)).value
        except ModelFault:
            if engine != "exact":
                raise
            continue  # irrational
        assert float(found) == pytest.approx(float(expected), abs=1e-6), text
