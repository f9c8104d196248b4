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
    sure, undecided = values(0.1 + 0.2, 0.1 + 0.2, computed=True).compare(operator, Fraction(3, 10))
    assert undecided
    assert not sure


@given(
    st.sampled_from(["+", "-", "*", "/", "min", "max", "floor", "ceil", "round", "neg"]),
    *[doubles] * 4,
    st.booleans(),
    st.booleans(),
)
def test_arithmetic_keeps_the_truth(operator, a, b, c, d, first, second):
    x, y = values(min(a, b), max(a, b), first), values(min(c, d), max(c, d), second)
    for p in (Fraction(a), Fraction(b), (Fraction(a) + Fraction(b)) / 2):
        for q in (Fraction(c), Fraction(d)):
            low, high = _map(operator, x, y)
            true = _exact(operator, p, q)
            # Beyond the greatest double a value rounds to infinity, as everywhere in floating
            # point.
            if true is not None and not np.isnan(low) and abs(true) < Fraction(10) ** 300:
                slack = 1e-9 if first or second else 1e-12
                assert low - slack * (1 + abs(low)) <= true <= high + slack * (1 + abs(high))


def _map(operator, x, y):
    result = (
        x.map("-")
        if operator == "neg"
        else x.map(operator)
        if operator in ("floor", "ceil", "round")
        else x.map(operator, y)
    )
    return float(result.lower[0]), float(result.upper[0])


def _exact(operator, p, q):
    match operator:
        case "+":
            return p + q
        case "-":
            return p - q
        case "*":
            return p * q
        case "/":
            return None if q == 0 else p / q
        case "min":
            return min(p, q)
        case "max":
            return max(p, q)
        case "neg":
            return -p
        case "floor":
            return p.__floor__()
        case "ceil":
            return p.__ceil__()
        case "round":
            return (p + Fraction(1, 2)).__floor__()


def test_a_difference_of_computed_values_has_their_error():
    """0.3 - (0.1 + 0.2) is not known to be negative, zero or positive."""
    difference = values(0.3, 0.3, computed=True).map(
        "-", values(0.1 + 0.2, 0.1 + 0.2, computed=True)
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
