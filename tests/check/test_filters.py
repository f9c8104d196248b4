"""Filters, and what is printed of them."""

from __future__ import annotations

from math import inf, isnan

import pytest

from checking import RESULTS, check_text, engine_of
from symcheck.check.result import Certified, Exact
from symcheck.engines.registry import BUILDERS
from symcheck.errors import InputError

DIE = (RESULTS / "die.pm").read_text()
MANY = (RESULTS / "many.pm").read_text()


@pytest.mark.parametrize("name", BUILDERS)
@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("filter(min, P=? [ F x=4 ])", 0),
        ("filter(max, P=? [ F x=4 ], x<4)", 0.75),
        ("filter(+, P=? [ F x=4 ])", 2.5),
        ("filter(sum, x)", 10),
        ("filter(avg, P=? [ F x=4 ])", 0.5),
        ("filter(avg, x, x>2)", 3.5),
        ("filter(count, P>0.4 [ F x=4 ])", 3),
        ("filter(range, x, x>1)", (2, 4)),
        ("filter(&, x<5)", True),
        ("filter(forall, x<4)", False),
        ("filter(|, x>3)", True),
        ("filter(exists, x>4)", False),
        ("filter(first, x, x>1)", 2),
        ("filter(first, x>2, x>1)", False),
        ("filter(state, x=3, x=3)", True),
        ("filter(count, filter(argmax, P=? [ F x=4 ], x<4) & x=3)", 1),
        ("filter(count, filter(argmin, x))", 1),
        ("filter(max, P=? [ F x=4 ], x<4) + filter(min, x, x>2)", (3.75, 3.75)),
        ("P=? [ F x=4 {x=1} ]", 0.25),
        ("P=? [ F x=4 {x<4}{max} ]", 0.75),
        ("P=? [ F x=4 {x<4}{min}{max} ]", (0, 0.75)),
    ],
)
def test_values(name, formula, value):
    found = check_text(engine_of(MANY, name), formula).value
    if isinstance(value, bool):
        assert found is value
    else:
        assert found == pytest.approx(value)


@pytest.mark.parametrize("name", BUILDERS)
def test_printed_lines(name):
    result = check_text(engine_of(MANY, name), "filter(printall, P=? [ F x=4 ])")
    assert result.value == pytest.approx(
        (0, 1)
    )  # over the five initial states, as the formula itself
    assert [
        (line.index, line.state, pytest.approx(float(line.value))) for line in result.lines
    ] == [
        (0, (0,), 0.0),
        (1, (1,), 0.25),
        (2, (2,), 0.5),
        (3, (3,), 0.75),
        (4, (4,), 1.0),
    ]
    same = check_text(engine_of(MANY, name), "filter(values, P=? [ F x=4 ])")
    assert same.lines == result.lines
    nonzero = check_text(engine_of(MANY, name), "filter(print, P=? [ F x=4 ], x<3)")
    assert [line.index for line in nonzero.lines] == [1, 2]
    assert nonzero.value == pytest.approx((0, 1))
    true = check_text(engine_of(MANY, name), "filter(print, x>2)")
    assert true.value is False
    assert [str(line) for line in true.lines] == ["3:(3)=true", "4:(4)=true"]


@pytest.mark.parametrize(
    ("formula", "reason"),
    [
        ("filter(state, x, x>2)", "selects 2 states"),
        ("filter(max, x, x>9)", "no state"),
        ("filter(forall, x>0, x>9)", "no state"),
    ],
)
def test_refused(formula, reason):
    with pytest.raises(InputError, match=reason):
        check_text(engine_of(MANY), formula)


def test_a_filter_inside_is_the_same_everywhere():
    assert (
        check_text(engine_of(DIE), 'P>=1 [ F filter(max, P=? [ F "six" ], s=2) > 0.3 ]').value
        is True
    )


def test_result_as_text():
    engine = engine_of(MANY)
    assert str(check_text(engine, "P=? [ F x>=0 ]")) == "[1.0,1.0] (exact)"
    assert (
        str(check_text(engine, "filter(state, P=? [ F x=4 ], x=2)")) == "0.5 (exact up to rounding)"
    )
    assert str(check_text(engine, "filter(count, x>1)")) == "3 (exact)"
    assert str(check_text(engine, "x>=0")) == "true"
    assert (
        str(check_text(engine_of(MANY, "exact"), "filter(state, P=? [ F x=4 ], x=1)"))
        == "1/4 (exact)"
    )
    certified = check_text(engine_of((RESULTS / "queue.sm").read_text()), "P=? [ F<=1 k=2 ]")
    assert "(certified: +/- " in str(certified)


WALK = "module m x : [0..6]; [] true -> (x'=mod(x+1,7)); endmodule rewards true : 0.1 + 0.2; endrewards"


@pytest.mark.parametrize("name", BUILDERS)
def test_what_is_divided_or_added_in_floating_point_is_not_called_exact(name):
    model = engine_of("dtmc " + WALK, name)
    rounding = name != "exact"
    assert check_text(model, "filter(avg, x=1 ? 1 : 0)").accuracy == Exact(rounding=rounding)
    assert check_text(model, "R=? [ S ]").accuracy == Exact(rounding=rounding)
    assert check_text(model, "filter(avg, x)").accuracy == Exact()


@pytest.mark.parametrize("name", BUILDERS)
@pytest.mark.parametrize("operator", ["min", "max", "sum", "avg", "first"])
@pytest.mark.parametrize("number", ["0/x", "0/(x-4)"])  # NaN in the first state, in the last one
def test_nan_in_one_state_is_nan_for_all(name: str, operator: str, number: str) -> None:
    one = "filter(state, {}, x={})".format(number, 0 if number == "0/x" else 4)
    everywhere = f"filter({operator}, {number})" if operator != "first" else one
    assert isnan(check_text(engine_of(MANY, name), everywhere).value)


@pytest.mark.parametrize("name", BUILDERS)
def test_a_sum_with_infinity_may_have_numbers_beyond_doubles(name: str) -> None:
    found = check_text(engine_of(MANY, name), "filter(sum, x=0 ? 1/x : pow(10.0, 400*x))").value
    assert found == inf


@pytest.mark.parametrize("name", [name for name in BUILDERS if name != "exact"])
def test_a_sum_with_a_value_that_doubles_lose_is_not_exact(name):
    text = "ctmc module m x:[0..1]; [] x=0 -> 1e-150:(x'=1); [] x=1 -> 1e9:(x'=0); endmodule"
    for operator, value in (("sum", 1), ("avg", 0.5)):
        found = check_text(
            engine_of(text, name), f"filter({operator}, P=? [ F<=1e-170 x=1 ], true)"
        )
        assert isinstance(found.accuracy, Certified)
        assert found.accuracy.lower <= value < found.accuracy.upper  # and 1e-320 of it
        assert found.value == value


@pytest.mark.parametrize("name", BUILDERS)
@pytest.mark.parametrize("formula", ["P=? [ F<=2 s=1 ]", 'R{"b"}=? [ I=2 ]'])
def test_values_that_differ_by_less_than_rounding_are_not_equal(name, formula):
    """State 0 has 1-1e-200, by doubles as much as state 1, which has 1."""
    text = (
        "dtmc module m s:[0..1]; [] s=0 -> 1-1e-100:(s'=1) + 1e-100:true; [] s=1 -> true; endmodule"
        ' rewards "b" s=1 : 1; endrewards'
    )
    for operator, state in (("argmin", 0), ("argmax", 1)):
        found = check_text(engine_of(text, name), f"filter({operator}, {formula}, true)")
        assert [line.index for line in found.lines] == [state]
