"""Values beyond doubles, and what is printed of differences: no number is called what it is not."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.errors import UnsupportedError

ENGINES = ["auto", "explicit", "sparse", "hybrid", "mtbdd"]
LARGEST = 1.7976931348623157e308

MODEL = """{kind}
module m
  s : [0..3];
  [a] s<3 -> 0.5:(s'=s+1) + 0.5:true;
  [] s=3 -> true;
endmodule
rewards "two" s=1 : 1e308; s=2 : 1e308; endrewards
rewards "joint" s=1 : 1e308; [a] s=1 : 1e308; endrewards
rewards "signs" s=1 : 1.5e308; s=2 : -1.5e308; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("kind", "query", "least"),
    [("dtmc", "C<=3", ""), ("mdp", "C<=3", "max"), ("dtmc", "C<=400", ""), ("ctmc", "C<=400", "")],
)
def test_a_bounded_reward_beyond_doubles_is_refused(engine, kind, query, least):
    model = symcheck.loads(MODEL.format(kind=kind), engine=engine)
    for name in ("two", "signs") if query == "C<=400" else ("two",):
        with pytest.raises(UnsupportedError, match="beyond the range of floating-point") as error:
            model.check(f'R{{"{name}"}}{least}=? [ {query} ]')
        # Rewards until a time have no rational values.
        assert error.value.hint == (None if kind == "ctmc" else "use -exact")
    with pytest.raises(UnsupportedError, match="the reward of a step is beyond"):
        model.check(f'R{{"joint"}}{least}=? [ {query} ]')


def test_rational_arithmetic_computes_it():
    model = symcheck.loads(MODEL.format(kind="dtmc"), exact=True)
    assert model.check('R{"two"}=? [ C<=3 ]').value == 10**308 * Fraction(5, 4)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("formula", "truth"),
    [
        ('filter(sum, R{"two"}=? [ C<=1 ])', 2 * 10**308),
        ('R{"two"}=? [ C<=2 ] * 10', 5 * 10**308),
        ('R{"two"}=? [ C<=2 ] * -10', -5 * 10**308),
        ("P=? [ F s=3 ] * pow(10.0, 309)", 10**309),
        ("1e-400", Fraction(1, 10**400)),
    ],
)
def test_a_number_beyond_doubles_has_bounds(engine, formula, truth):
    result = symcheck.loads(MODEL.format(kind="dtmc"), engine=engine).check(formula)
    assert isinstance(result.accuracy, Certified)
    assert result.accuracy.lower <= truth <= result.accuracy.upper
    assert result.accuracy.epsilon > 0
    assert str(result.accuracy) != "certified: +/- 0.0E+00"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sum_whose_partial_sums_overflow_is_found(engine):
    text = MODEL.format(kind="dtmc") + (
        'rewards "back" s=0 : 1.5e308; s=1 : 1.5e308; s=2 : -1.5e308; endrewards'
    )
    result = symcheck.loads(text, engine=engine).check('filter(sum, R{"back"}=? [ I=0 ])')
    assert result.value == pytest.approx(1.5e308)
    assert result.value <= LARGEST


@pytest.mark.parametrize("engine", ENGINES)
def test_division_by_zero_is_no_overflow(engine):
    model = symcheck.loads(MODEL.format(kind="dtmc"), engine=engine)
    assert model.check("P=? [ F<=3 s=3 ] / 0").value == float("inf")


DIFFERENT = 'filter(sum, R{"tenths"}=? [ C<=1 ])'
"""Of -1e10, 0.3 and 1e10."""
TENTHS = 'rewards "tenths" s=0 : -1e10; s=1 : 0.3; s=2 : 1e10; endrewards'


@pytest.mark.parametrize("engine", ENGINES)
def test_a_range_is_as_accurate_as_its_less_accurate_end(engine):
    model = symcheck.loads(MODEL.format(kind="dtmc"), engine=engine)
    assert model.check("filter(range, s*0.1)").accuracy == Exact(rounding=True)
    assert model.check("filter(range, s*0.5)").accuracy == Exact()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "formula", ["1 - P=? [ F<=3 s=3 ] - 0.875", "floor(P=? [ F<=3 s=3 ] * 8)", DIFFERENT]
)
def test_a_formula_that_amplifies_errors_is_a_warning(engine, formula):
    result = symcheck.loads(MODEL.format(kind="dtmc") + TENTHS, engine=engine).check(formula)
    truth = 0 if formula.startswith("1") else Fraction(3, 10) if formula == DIFFERENT else 1
    assert result.accuracy.lower <= truth <= result.accuracy.upper
    (warning,) = result.warnings
    assert "apart, relative to their value, further than asked for" in warning
