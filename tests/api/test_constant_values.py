"""Values of constants, given as a text or as a mapping."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import symcheck
from symcheck.constant_values import combinations, parse_constants
from symcheck.errors import NameFault, UsageError

MODEL = """dtmc const int N; const double p; module m x : [0..N];
  [] x<N -> p:(x'=x+1) + 1-p:(x'=0); [] x=N -> true; endmodule"""


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("x=1", {"x": ("1",)}),
        ("N=2:4, K={2,5}", {"N": ("2", "3", "4"), "K": ("2", "5")}),
        ("p=0.1:0.1:0.3", {"p": ("0.1", "0.2", "0.3")}),
        ("p=1/3:1/3:1", {"p": ("1/3", "2/3", "1.0")}),
        ("N=2:2:7", {"N": ("2", "4", "6")}),
        ("x=max(1,2),b=true", {"x": ("max(1,2)",), "b": ("true",)}),
        ("", {}),
    ],
)
def test_texts(text, values):
    assert parse_constants([text]) == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x", "'x' is not of the form NAME=VALUE"),
        ("=1", "is not of the form"),
        ("x=", "is not of the form"),
        ("x=1,x=2", "x is given twice"),
        ("x={}", "the list of values of x is empty"),
        ("x={1,2", r"'x=\{1,2' lacks a bracket: a list is written as \{V,W\}"),
        ("x=1}", "'x=1}' lacks a bracket"),
        ("x=3:1", "the range 'x=3:1' is empty"),
        ("x=1:0:3", "the step of the range 'x=1:0:3' is not above 0"),
        ("x=1:a", "needs plain numbers"),
        ("x=1:2:3:4", "has more than LOW:STEP:HIGH"),
    ],
)
def test_faulty_texts(text, message):
    with pytest.raises(UsageError, match=f"^-const: .*{message}"):
        parse_constants([text])
    with pytest.raises(UsageError, match=f"^constants: .*{message}"):
        symcheck.loads(MODEL, text)


def test_combinations_change_the_last_constant_first():
    chosen = [tuple(c.values()) for c in combinations({"a": "12", "b": "34"})]
    assert chosen == [("1", "3"), ("1", "4"), ("2", "3"), ("2", "4")]


@pytest.mark.parametrize(
    "constants",
    [
        "N=2,p=0.25",
        {"N": 2, "p": 0.25},
        {"N": "1+1", "p": "1/4"},
        {"N": np.int64(2), "p": Fraction(1, 4)},
    ],
)
def test_a_model_takes_a_mapping_or_a_text(constants):
    model = symcheck.loads(MODEL, constants)
    assert model.check("P=? [ F<=2 x=N ]").value == 1 / 16
    other = symcheck.loads(MODEL).with_constants(constants)
    assert other.check("const int k; P=? [ F<=k x=N ]", "k=2").value == 1 / 16


@pytest.mark.parametrize(
    ("constants", "message"),
    [
        ("N=2:4,p=0.5", r"N is given 3 values \(2, 3, 4\), and one value is expected"),
        ({"N": [2, 3]}, r"N is given \[2, 3\], and one value is expected"),
        ({"N": None}, "N is given None, and one value is expected"),
        (3, "expected a mapping or a text such as 'N=3,p=0.5', not 3"),
    ],
)
def test_one_value_for_each_constant(constants, message):
    with pytest.raises(UsageError, match=f"^constants: {message}"):
        symcheck.loads(MODEL, constants)


def test_a_constant_that_does_not_exist():
    with pytest.raises(NameFault, match="constant n is given a value"):
        symcheck.loads(MODEL, "n=2").check("P=? [ F x=1 ]")
