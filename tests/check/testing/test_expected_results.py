"""The convention of RESULT lines."""

from __future__ import annotations

from fractions import Fraction
from math import inf, nan

import pytest

from symcheck.check.result import Certified, Exact, Result, SolverRun, Statistical
from symcheck.check.testing.expected_results import VerdictKind, expected_value, judge
from symcheck.errors import (
    InternalError,
    ModelFault,
    NumericalError,
    TimeLimitError,
    TypeFault,
    UnsupportedError,
)

PASS, FAIL = VerdictKind.PASS, VerdictKind.FAIL
SOLVED = (SolverRun("linear", "topological", 5, 1),)
STEPPED = (SolverRun("steps", "step by step", 5, 3),)


def verdict(expected, value, constants=None, runs=SOLVED, exact=False):
    return judge(
        [f"RESULT: {expected}"], Result(value, Exact(), runs=runs), constants or {}, exact=exact
    ).kind


@pytest.mark.parametrize(
    ("comments", "constants", "expected"),
    [
        (["RESULT: 1/6"], {}, "1/6"),
        (["a line of prose", "RESULT:0.5 and a remark"], {}, "0.5"),
        (["RESULT (N=2): 3", "RESULT (N=3): 4", "RESULT: 5"], {"N": 3}, "4"),
        (["RESULT (N=2): 3", "RESULT: 5"], {"N": 7}, "5"),
        (["RESULT (N=2,p=0.50): 3"], {"N": 2, "p": 0.5}, "3"),
        (["RESULT (N=2,p=0.5): 3"], {"N": 2, "p": 0.25}, None),
        (["RESULT (N=2.0): 3"], {"N": 2}, None),
        (["RESULT (b=true): 3"], {"b": True}, "3"),
        (["RESULT (b=true): 3"], {"b": False}, None),
        (["RESULT (x=1/3): 3"], {"x": Fraction(1, 3)}, "3"),
        (["RESULT (M=1): 3"], {"N": 1}, None),
        (["no result"], {}, None),
    ],
)
def test_selection(comments, constants, expected):
    assert expected_value(comments, constants) == expected


@pytest.mark.parametrize(
    ("expected", "value", "kind"),
    [
        ("true", True, PASS),
        ("false", True, FAIL),
        ("N>2", True, PASS),
        ("N>3", True, FAIL),
        ("3", 3, PASS),
        ("N", 3, PASS),
        ("4", 3, FAIL),
        ("0.5", 0.5, PASS),
        ("[0.4,0.6]", 0.5, PASS),
        ("[0.1,1/2]", 0.5, PASS),
        ("[0.1,0.2]", 0.5, FAIL),
        ("0.5000049", 0.5, PASS),
        ("0.500006", 0.5, FAIL),
        ("1/6", 1 / 6, PASS),
        ("1-p", 0.75, PASS),
        ("pow(p,2)", 0.0625, PASS),
        ("log(p,2)", -2.0, PASS),
        ("~0.5", 0.5, PASS),
        ("Infinity", inf, PASS),
        ("-Infinity", -inf, PASS),
        ("Infinity", 1e300, FAIL),
        ("1e300", inf, FAIL),
        ("NaN", nan, PASS),
        ("NaN", 0.5, FAIL),
        ("0.5", nan, FAIL),
        ("[0.25,0.5]", (0.25, 0.5), PASS),
        ("[0.25,0.6]", (0.25, 0.5), FAIL),
        ("0.25", (0.25, 0.25), FAIL),
        ("[(1,0.5),(0,2)]", [(0.0, 2.0), (1.0, 0.500001)], PASS),
        ("[(1,0.5)]", [(0.0, 2.0), (1.0, 0.5)], FAIL),
        ("unknown+1", 0.5, FAIL),
    ],
)
def test_values(expected, value, kind):
    assert verdict(expected, value, {"N": 3, "p": 0.25}) is kind


def test_steps_are_compared_more_strictly():
    assert verdict("0.5000001", 0.5, runs=SOLVED) is PASS
    assert verdict("0.5000001", 0.5, runs=STEPPED) is FAIL
    assert verdict("~0.5000001", 0.5, runs=STEPPED) is PASS


def test_exact_arithmetic_is_compared_exactly():
    assert verdict("1/3", Fraction(1, 3), exact=True) is PASS
    assert verdict("0.333333333333", Fraction(1, 3), exact=True) is FAIL
    assert verdict("~0.3333333", Fraction(1, 3), exact=True) is PASS


def test_errors():
    error, unsupported = NumericalError("no"), UnsupportedError("never")
    assert judge(["RESULT: Error"], error, {}).kind is PASS
    assert judge(["RESULT: Error:words"], error, {}).kind is PASS
    assert judge(["RESULT: Error"], Result(True), {}).kind is FAIL
    assert judge(["RESULT: true"], error, {}).kind is FAIL
    assert judge(["RESULT: true"], unsupported, {}).kind is VerdictKind.UNSUPPORTED
    assert judge(["RESULT: ?"], error, {}).kind is VerdictKind.NOT_TESTED
    assert judge([], Result(0.5, Certified(0.4, 0.6)), {}).kind is VerdictKind.NOT_TESTED


@pytest.mark.parametrize("expected", ["Error", "Error:negative", "Error:fractional (remark)"])
def test_a_refusal_is_an_expected_error_but_a_defect_and_a_limit_are_none(expected):
    fitting = UnsupportedError("never"), TypeFault(), ModelFault(), NumericalError("no")
    for error in fitting:
        assert judge([f"RESULT: {expected}"], error, {}).kind is PASS
    for error in (InternalError("broken"), TimeLimitError("late"), ValueError("broken")):
        assert judge([f"RESULT: {expected}"], error, {}).kind is FAIL


def test_what_is_not_tested_says_why():
    sample = Result(0.5, Statistical(0.99, 0.4, 0.6, 100))
    for comments, outcome, why in (
        ([], Result(0.5), "no RESULT line"),
        (["RESULT (N=2): 1"], Result(0.5), "no RESULT line has these constants"),
        (["RESULT: ?"], Result(0.5), "the expected result is unknown"),
        (["RESULT: 0.5"], sample, "the result is an estimate"),
        ([], NumericalError("no"), "an error, and no RESULT line"),
    ):
        assert str(judge(comments, outcome, {"N": 1})) == f"NOT TESTED: {why}"


def test_verdict_as_text():
    assert str(judge(["RESULT: true"], Result(True), {})) == "PASS"
    assert (
        str(judge(["RESULT: true"], Result(False), {}))
        == "FAIL: true was expected, and the result is false"
    )
