"""Expressions in properties: rational values on every engine, or values that say their rounding."""

from __future__ import annotations

from fractions import Fraction
from math import ulp

import pytest

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.errors import NumericalError
from symcheck.options import EngineName

MODEL = """
dtmc
const double p = 0.1;
const double r;
module m
  s : [0..3] init 0;
  [] s=0 -> 3/10:(s'=1) + 7/10:(s'=2);
  [] s=1 -> 0.5:(s'=0) + 0.5:(s'=3);
  [] s>=2 -> true;
endmodule
"""
ENGINES: list[dict[str, object]] = [
    {},
    {"engine": "explicit"},
    {"engine": "sparse"},
    {"engine": "hybrid"},
    {"engine": "mtbdd"},
    {"exact": True},
]
LARGE = 2**53 + 1


@pytest.fixture(params=ENGINES, ids=lambda o: next(iter(map(str, o.values())), "auto"))
def model(request: pytest.FixtureRequest) -> symcheck.Model:
    return symcheck.loads(MODEL, constants={"r": "1/3"}, **request.param)


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        (f"{LARGE}*3", 3 * LARGE),
        (f"{LARGE}+s", LARGE),
        (f"-{LARGE}", -LARGE),
        ("floor((0.1+0.7)*10)", 8),
        ("ceil(0.1*3*10)", 3),
        ("filter(max, floor((0.1+0.7)*10+s))", 11),
        ("mod(floor(0.3/0.1), 2)", 1),
        (f"filter(sum, {LARGE}+s)", 4 * LARGE + 6),
        (f"filter(sum, {LARGE})", 4 * LARGE),
        (f"filter(min, {LARGE}-s)", LARGE - 3),
        (f"filter(max, {LARGE}+s)", LARGE + 3),
        (f"filter(state, {LARGE}+s, s=1)", LARGE + 1),
        (f"s=0 ? {LARGE} : 2", LARGE),
    ],
)
def test_ints_are_exact_beyond_doubles(model: symcheck.Model, formula: str, value: int):
    result = model.check(formula)
    assert result.value == value
    assert result.accuracy == Exact()


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("0.1+0.2", Fraction(3, 10)),
        ("3*p", Fraction(3, 10)),
        ("r*3", Fraction(1)),
        ("0.25+s", Fraction(1, 4)),
        ("filter(sum, 0.1*s)", Fraction(6, 10)),
        ("filter(avg, s/3)", Fraction(1, 2)),
        (f"filter(avg, {LARGE}+s)", Fraction(4 * LARGE + 6, 4)),
        ("filter(avg, 1e16*(s=0 ? 1 : s=1 ? -1 : 1e-16))", Fraction(1, 2)),
        ("(P=? [ F true ]) + 1/3", Fraction(4, 3)),
        ("(P=? [ F true ]) * 0.1", Fraction(1, 10)),
    ],
)
def test_doubles_are_the_nearest_ones_and_say_whether_they_are_exact(
    model: symcheck.Model, formula: str, value: Fraction
):
    result = model.check(formula)
    if model.options.exact:
        assert result.value == value
    else:
        lower, upper = result.bounds
        assert lower <= value <= upper
        distance = abs(result.value - value)
        assert distance <= 2 * ulp(float(value)) if "P" in formula else result.value == float(value)
        assert result.accuracy == Exact(rounding=Fraction(float(value)) != value)


@pytest.mark.parametrize(
    "formula",
    [
        "0.1+0.2=0.3",
        "3*p=0.3",
        "r*3=1",
        "r=1/3",
        "filter(sum, 0.1*s)=0.6",
        "filter(avg, 0.1*s)=0.15",
        f"filter(sum, {LARGE}+s)={4 * LARGE + 6}",
        f"filter(sum, {LARGE}+s)>{4 * LARGE + 5}",
        "(P=? [ F true ])*0.1+0.2=0.3",
        "(P=? [ F true ])*0.1+0.2<=0.3",
        "P=? [ X s=1 ] = 0.1+0.2",
        "P>=0.1+0.2 [ X s=1 ]",
        "P<=r*9/10 [ X s=1 ]",
        "P=? [ F s=3 ] - P=? [ F s=2 ] = -11/17",
        "P=? [ F s=3 ] - 3/17 = 0",
        "!((P=? [ F s=3 ] - 3/17) < 0)",
    ],
)
def test_comparisons_are_not_decided_by_rounding(model: symcheck.Model, formula: str):
    assert model.check(formula).value is True


def test_a_difference_of_near_values_has_bounds(model: symcheck.Model):
    result = model.check("P=? [ F s=3 ] - 3/17")
    low, high = result.bounds
    assert low <= 0 <= high
    assert high - low < 1e-11


def test_what_no_double_is_near_has_bounds():
    model = symcheck.loads(MODEL, constants={"r": 1})
    for formula, value in (
        ("1e300*1e300", Fraction(10**600)),
        ("1e-300*1e-300", Fraction(1, 10**600)),
    ):
        accuracy = model.check(formula).accuracy
        assert isinstance(accuracy, Certified)
        assert accuracy.lower < value < accuracy.upper


def test_a_number_is_not_called_exact_if_it_is_irrational():
    model = symcheck.loads(MODEL, constants={"r": 1})
    for formula in ("pow(2,0.5)", "log(3,2)", "log(s+3,2)", "filter(max, pow(s+2, 0.5))"):
        assert model.check(formula).accuracy != Exact()
    assert model.check("P>=pow(2,-0.5) [ F s>=2 ]").value is True


def test_a_model_with_many_states_says_that_sums_are_rounded():
    """They are computed in floating point."""
    text = "dtmc module m x : [0..29999]; [] true -> (x'=mod(x+1,30000)); endmodule"
    for engine in ("explicit", "mtbdd"):
        name: EngineName = engine
        model = symcheck.loads(text, engine=name)
        assert model.check("filter(sum, x)").value == 449985000
        assert model.check("filter(sum, x)").accuracy == Exact()
        assert model.check("filter(sum, 0.1*x)").accuracy == Exact(rounding=True)
        assert model.check("filter(max, x*0.1+0.2-0.3)>2999.7").value is True
        with pytest.raises(NumericalError, match="cannot decide"):
            model.check("filter(max, x*0.1+0.2-0.3)=2999.8")
        large = model.check(f"filter(sum, {LARGE}+x)")
        assert large.accuracy == Exact(rounding=True)
        assert large.value == pytest.approx(30000 * LARGE + 449985000, rel=1e-14)


def test_given_fractions_decide_thresholds_exactly():
    """In rational arithmetic the constant is 1/3, not the double next to it."""
    text = "dtmc const double p; module m s:[0..2]; [] s=0 -> p:(s'=1)+1-p:(s'=2); [] s>0 -> true; endmodule"
    for given in ("1/3", Fraction(1, 3)):
        model = symcheck.loads(text, constants={"p": given})
        assert model.check("P>=1/3 [ F s=1 ]").value is True
        assert model.check("P<=1/3 [ F s=1 ]").value is True
        assert model.check("P<1/3 [ F s=1 ]").value is False
        assert model.check("P=? [ F s=1 ] = p").value is True


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_a_product_that_underflows_has_bounds(engine: EngineName):
    """The square of 1e-200 is positive, though its double is 0."""
    text = "dtmc module m s:[0..2]; [] s=0 -> 1e-200:(s'=1) + 1-1e-200:(s'=2); [] s>0 -> true; endmodule"
    model = symcheck.loads(text, engine=engine)
    low, high = model.check("P=? [ F s=1 ] * P=? [ F s=1 ]").bounds
    assert low <= Fraction(1, 10**400) <= high < 1e-300
    assert model.check("P=? [ F s=1 ] * P=? [ F s=1 ] > 0").value is True
    assert model.check("P=? [ F s=1 ] * 0 > 0").value is False
    assert model.check("P=? [ F s=1 ] * 0").value == 0


@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd"])
@pytest.mark.parametrize("formula", ["pow(10,-400.5)", "pow(0.1,s+400.5)", "pow(1/3,s+900.5)"])
def test_a_power_that_underflows_is_not_called_an_exact_0(engine: str, formula: str) -> None:
    text = "dtmc module m s : [0..1]; [] true -> 0.5 : (s'=1) + 0.5 : true; endmodule"
    accuracy = symcheck.loads(text, engine=engine).check(formula).accuracy
    assert isinstance(accuracy, Certified)
    assert accuracy.lower <= 0 < accuracy.upper < 1e-300
