"""Path formulas in normal form: next and until, negation and logical operators over state formulas."""

from __future__ import annotations

import pytest

from symcheck.errors import InputError
from symcheck.semantics.binding.bind import bind, bind_properties
from symcheck.semantics.path_normal_form import (
    Connected,
    Negated,
    NextState,
    StateFormula,
    UntilReached,
    normal_form,
    state_formulas,
)
from symcheck.semantics.rewards import Steps, Structure
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.operators import Operator
from symcheck.syntax.parse import parse_model, parse_properties
from symcheck.syntax.printer import pretty

MODEL = bind(
    parse_model(
        "dtmc module m a : bool; b : bool; c : bool; [] true -> true; endmodule rewards true : 1; endrewards"
    )
)


def form_of(path: str):
    (bound,) = bind_properties(parse_properties(f"P=? [ {path} ]"), MODEL).properties
    return normal_form(bound.formula.path, MODEL)


def shown(form) -> str:
    match form:
        case StateFormula(formula):
            return pretty(formula)
        case Negated(operand):
            return f"not ({shown(operand)})"
        case Connected(operator, left, right):
            return f"({shown(left)}) {operator} ({shown(right)})"
        case NextState(operand, _):
            return f"X ({shown(operand)})"
        case UntilReached(left, right, _):
            return f"({shown(left)}) U ({shown(right)})"


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("a & !b", "a & !b"),
        ("a ? b : c", "a ? b : c"),
        ("X a", "X (a)"),
        ("F a", "(true) U (a)"),
        ("G a", "not ((true) U (!a))"),
        ("a U b", "(a) U (b)"),
        ("a R b", "not ((!a) U (!b))"),
        ("a W b", "not ((!b) U (!a & !b))"),
        ("a W>=2 b", "not ((a & !b) U (!a & !b))"),
        ("!(F a)", "not ((true) U (a))"),
        ("!(G a)", "(true) U (!a)"),
        ("!!(X a)", "X (a)"),
        ("F (G a)", "(true) U (not ((true) U (!a)))"),
        ("G (a => (F b))", "not ((true) U (not ((a) => ((true) U (b)))))"),
        ("(F a) <=> b", "((true) U (a)) <=> (b)"),
        ("(F a) ? b : c", "(((true) U (a)) => (b)) & (((true) U (a)) | (c))"),
    ],
)
def test_normal_forms(path: str, expected: str) -> None:
    assert shown(form_of(path)) == expected


def test_bounds_are_evaluated() -> None:
    form = form_of("a U[1+1,4] b")
    assert isinstance(form, UntilReached)
    assert isinstance(form.extent, Window)
    assert (form.extent.lower, form.extent.upper) == (2, 4)
    form = form_of("F^{rew{1}<=3, steps<=5} b")
    assert isinstance(form, UntilReached)
    assert not isinstance(form.extent, Window)
    assert [count.reward for count in form.extent] == [Structure(0), Steps()]


def test_an_empty_window_is_refused() -> None:
    path = parse_properties("P=? [ F[3,2] a ]").properties[0].formula.path
    with pytest.raises(InputError, match="no time satisfies"):
        normal_form(path, MODEL)


def test_state_formulas_are_collected() -> None:
    assert [pretty(f) for f in state_formulas(form_of("(a U b) & (X c)"))] == ["a", "b", "c"]
    assert Operator.AND in {f.operator for f in [form_of("(F a) & (F b)")]}
