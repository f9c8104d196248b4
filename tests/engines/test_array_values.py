"""Values with bounds: comparisons never decide what the bounds leave open, and arithmetic keeps the
truth inside.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symcheck.engines.base import bracket
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.errors import ModelFault
from symcheck.semantics.expressions.evaluate import evaluate_closely
from symcheck.syntax.ast import Literal, Type
from symcheck.syntax.operators import Function, Operator, Signature, UnaryOperator
from syntax.operations import NUMERIC, applied

CONDITIONS = (Signature.EQUALITY, Signature.ORDER)
NEAR_HALVES = [0.1, 0.5, -2.5, 0.49999999999999994, 4503599627370495.5]

TESTS = {
    ">=": lambda v, t: v >= t,
    ">": lambda v, t: v > t,
    "<=": lambda v, t: v <= t,
    "<": lambda v, t: v < t,
    "=": lambda v, t: v == t,
    "!=": lambda v, t: v != t,
}
doubles = st.floats(-10, 10).map(lambda x: 0.0 if x == 0 else x)
thresholds = st.one_of(doubles, st.fractions(-3, 3, max_denominator=12))


def values(low, high, computed=False):
    mask = np.ones(1, bool) if computed else None
    a, b = np.array([low]), np.array([high])
    return ArrayValues(a, a if low == high else b, mask)


@given(thresholds)
def test_bracket(threshold):
    below, above = bracket(threshold)
    assert Fraction(below) <= Fraction(threshold) <= Fraction(above)
    assert above == below or np.nextafter(below, np.inf) == above


@given(doubles, doubles, st.fractions(0, 1), thresholds, st.sampled_from(sorted(TESTS)))
def test_comparison_of_bounds(x, y, share, threshold, operator):
    low, high = min(x, y), max(x, y)
    sure, undecided = values(low, high).compare(operator, threshold)
    true = Fraction(low) + share * (Fraction(high) - Fraction(low))
    if sure.members[0]:
        assert TESTS[operator](true, Fraction(threshold))
    elif not undecided.members[0]:
        assert not TESTS[operator](true, Fraction(threshold))
    assert not (sure & undecided)


@given(doubles, thresholds, st.sampled_from(sorted(TESTS)))
def test_known_values_are_always_decided(x, threshold, operator):
    sure, undecided = values(x, x).compare(operator, threshold)
    assert not undecided
    assert bool(sure) == TESTS[operator](Fraction(x), Fraction(threshold))


@pytest.mark.parametrize("operator", ["<", "<=", ">", ">=", "=", "!="])
def test_rounding_never_decides(operator):
    sum_of_doubles = values(0.1, 0.1).map(Operator.PLUS, values(0.2, 0.2))
    sure, undecided = sum_of_doubles.compare(operator, 0.1 + 0.2)
    assert undecided
    assert not sure


RESULTS = [(UnaryOperator.MINUS, 1), *((o, n) for o, n in NUMERIC if o.signature not in CONDITIONS)]


@pytest.mark.parametrize(("operation", "count"), RESULTS)
@given(st.data())
def test_arithmetic_keeps_the_truth(operation, count, data):
    """The exact value for operands at their bounds and between them is within the bounds."""
    whole = getattr(operation, "signature", None) is Signature.INTEGER
    numbers = st.integers(-10, 10).map(float) if whole else doubles
    if operation in (Operator.POWER, Function.POW, Function.LOG):  # exact values take long
        numbers = st.integers(-20, 20).map(lambda i: i / 4)
    pairs = [sorted(data.draw(st.tuples(numbers, numbers))) for _ in range(count)]
    marks = data.draw(st.tuples(*[st.booleans()] * count))
    first, *others = (values(*p, m) for p, m in zip(pairs, marks, strict=True))
    result = first.map(operation, *others)
    low, high = float(result.lower[0]), float(result.upper[0])
    shares = st.sampled_from([0, 1] if whole else [0, Fraction(1, 2), 1])
    for _ in range(4):
        point = [Fraction(a) + data.draw(shares) * (Fraction(b) - Fraction(a)) for a, b in pairs]
        true = _exact(operation, *point)
        if true is None or np.isnan(low) or np.isnan(high):
            continue
        # Beyond the greatest double a value rounds to infinity, as everywhere in floating point.
        if abs(true) < Fraction(10) ** 300:
            assert np.isinf(low) or Fraction(low) <= true
            assert np.isinf(high) or true <= Fraction(high)


def _exact(operation, *values):
    """The value, or what is near it; None: there is no number."""
    if isinstance(operation, UnaryOperator):
        return -values[0]
    if operation.signature is Signature.INTEGER:
        values = [int(v) for v in values]
    literals = (Literal(v, Type.INT if isinstance(v, int) else Type.DOUBLE) for v in values)
    try:
        value = evaluate_closely(applied(operation, *literals), {})
    except ModelFault:
        return None
    return None if isinstance(value, float) else Fraction(value)


@pytest.mark.parametrize(("operation", "count"), RESULTS)
@given(st.data())
def test_doubles_without_error_are_only_exact_where_the_value_is(operation, count, data):
    whole = getattr(operation, "signature", None) is Signature.INTEGER
    few = st.sampled_from([-3.0, 0.0, 1.0, 2.0, 49.0, 2.0**53, *([] if whole else NEAR_HALVES)])
    operands = [data.draw(few) for _ in range(count)]
    first, *others = (values(x, x) for x in operands)
    result = first.map(operation, *others)
    true = _exact(operation, *map(Fraction, operands))
    if true is None or result.computed is not None or not result.is_point:
        return
    assert Fraction(float(result.lower[0])) == true


def test_a_difference_of_computed_values_has_their_error():
    """0.3 - (0.1 + 0.2) is not known to be negative, zero or positive."""
    difference = values(0.3, 0.3).map(
        Operator.MINUS, values(0.1, 0.1).map(Operator.PLUS, Fraction(1, 5))
    )
    _, undecided = difference.compare(">", 0)
    assert undecided
    assert difference.lower < 0 < difference.upper


def test_sets():
    a, b = ArraySet(np.array([True, True, False])), ArraySet(np.array([False, True, True]))
    assert (a & b).count == 1
    assert (a | b).count == 3
    assert (a - b) == ArraySet(np.array([True, False, False]))
    assert (a & b) <= a
    assert not (a <= b)
    assert ~(a | b) == ArraySet(np.zeros(3, bool))
    assert not (a - a)


def test_choose_keeps_what_is_computed():
    x = ArrayValues(np.array([0.5, 0.5]), np.array([0.5, 0.5]), np.array([True, True]))
    known = ArrayValues(np.array([1.0, 1.0]), np.array([1.0, 1.0]))
    chosen = x.choose(ArraySet(np.array([True, False])), known)
    assert chosen.lower.tolist() == [0.5, 1.0]
    assert chosen.computed.tolist() == [True, False]
    assert chosen.rounded(ArraySet(np.array([True, True])))
    assert not chosen.rounded(ArraySet(np.array([False, True])))
