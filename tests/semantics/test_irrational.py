"""Enclosures of irrational numbers contain them, and never end a run with an error of Python."""

from __future__ import annotations

import math
import random
from decimal import MAX_EMAX, MIN_EMIN, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction

import pytest

from symcheck.errors import NO_SPAN, Diagnostic, ModelFault
from symcheck.semantics.expressions.evaluate import evaluate, evaluate_constant
from symcheck.semantics.expressions.irrational import exponential, logarithm
from symcheck.syntax.parse import parse_expression

WHY = Diagnostic("no exact value", NO_SPAN, "exact-power")
MANY_DIGITS = Context(300, ROUND_HALF_EVEN, MIN_EMIN, MAX_EMAX)


@pytest.mark.parametrize("digits", [5, 30, 120])
def test_an_enclosure_contains_the_exponential_of_numbers_of_both_signs(digits: int) -> None:
    draw = random.Random(1)
    for _ in range(300):
        number = Fraction(draw.randint(-(10**6), 10**6) or 1, 10 ** draw.randint(0, 6))
        low, high = exponential(number, WHY).enclose(digits)
        exact = MANY_DIGITS.exp(Decimal(number.numerator) / Decimal(number.denominator))
        if Fraction(Decimal(number.numerator) / Decimal(number.denominator)) == number:
            assert low <= exact <= high, number


@pytest.mark.parametrize("digits", [5, 30, 120])
def test_an_enclosure_contains_the_logarithm(digits: int) -> None:
    draw = random.Random(2)
    for _ in range(300):
        number = draw.randint(2, 10**9)
        low, high = logarithm(Fraction(number), WHY).enclose(digits)
        assert low <= MANY_DIGITS.ln(Decimal(number)) <= high, number


def test_a_double_has_all_its_digits_where_the_first_enclosure_has_none() -> None:
    quotient = parse_expression("1/(pow(2,0.5)-pow(2,0.5)*(1+1e-40))")
    assert math.isclose(evaluate(quotient, {}), -1e40 / math.sqrt(2))


@pytest.mark.parametrize("text", ["pow(2,pow(2,90.5))", "pow(2,5000.5)", "pow(2,-5000.5)"])
def test_a_constant_that_no_double_is_near_is_a_fault(text: str) -> None:
    """It would be a threshold of 0, or none."""
    with pytest.raises(ModelFault):
        evaluate_constant(parse_expression(text))


@pytest.mark.parametrize("negative", [False, True])
def test_an_exponential_of_a_number_of_millions_of_digits_ends(negative: bool) -> None:
    large = exponential(Fraction(10**7), WHY)
    with pytest.raises(ModelFault, match="digits do not decide"):
        float(exponential(-large if negative else large, WHY))
