from __future__ import annotations

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semantics.expressions import TYPES, anything, valuations
from symcheck.errors import ModelFault, NameFault, UnsupportedError
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import as_expression, type_of_value
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Binary, Expression, LabelReference, Literal, Name, Type, Unary
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.parse import parse_expression


def same(a: Value, b: Value) -> bool:
    """Equal and of one type, doubles up to rounding, with NaN equal to itself."""
    if isinstance(a, float) and isinstance(b, float):
        return (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-11)
    return type(a) is type(b) and a == b


VALUES: list[tuple[str, Value, Value]] = [
    ("7/2", 3.5, Fraction(7, 2)),
    ("6/2", 3.0, Fraction(3)),
    ("1+2*3-4", 3, 3),
    ("1+2.0", 3.0, Fraction(3)),
    ("-x", -3, -3),
    ("2^3", 8, 8),
    ("pow(2,3)", 8, 8),
    ("0^0", 1, 1),
    ("2.0^-1", 0.5, Fraction(1, 2)),
    ("2^-1.0", 0.5, Fraction(1, 2)),
    ("(-2)^3", -8, -8),
    ("0.0^-1", math.inf, math.inf),
    ("mod(7,3)", 1, 1),
    ("mod(-7,3)", 2, 2),
    ("mod(7,-3)", 1, 1),
    ("mod(-7,-3)", -4, -4),
    ("floor(-2.5)", -3, -3),
    ("ceil(-2.5)", -2, -2),
    ("round(2.5)", 3, 3),
    ("round(-2.5)", -2, -2),
    ("round(0.4)", 0, 0),
    ("floor(3)", 3, 3),
    ("log(8,2)", math.log(8) / math.log(2), Fraction(3)),
    ("log(2,8)", math.log(2) / math.log(8), Fraction(1, 3)),
    ("log(1/4,2)", math.log(0.25) / math.log(2), Fraction(-2)),
    ("log(1,7)", 0.0, Fraction(0)),
    ("log(0,2)", -math.inf, -math.inf),
    ("log(0,0.5)", math.inf, math.inf),
    ("log(-1,2)", math.nan, math.nan),
    ("log(3,1)", math.nan, math.nan),
    ("min(3,1,2)", 1, 1),
    ("max(3,1.5)", 3.0, Fraction(3)),
    ("min(3)", 3, 3),
    ("min(1,0/0)", math.nan, math.nan),
    ("max(0/0,1)", math.nan, math.nan),
    ("1/0", math.inf, math.inf),
    ("2^(1/0)", math.inf, math.inf),
    ("0.5^(1/0)", 0.0, Fraction(0)),
    ("(-1)^(1/0)", 1.0, Fraction(1)),
    ("2^(-1/0)", 0.0, Fraction(0)),
    ("(-1/0)^2", math.inf, math.inf),
    ("(-1/0)^3", -math.inf, -math.inf),
    ("(-1/0)^0.5", math.inf, math.inf),
    ("-1/0", -math.inf, -math.inf),
    ("0/0", math.nan, math.nan),
    ("1/0-1/0", math.nan, math.nan),
    ("0*(1/0)", math.nan, math.nan),
    ("-2*(1/0)+5", -math.inf, -math.inf),
    ("5/(1/0)", 0.0, Fraction(0)),
    ("1/0>1", True, True),
    ("0/0=0/0", False, False),
    ("0/0!=0/0", True, True),
    ("true?1:2.5", 1.0, Fraction(1)),
    ("false?1:2", 2, 2),
    ("(b?1:2.5)^-1", 1.0, Fraction(1)),
    ("b?true:false", True, True),
    ("true=>false", False, False),
    ("false=>mod(1,0)=1", True, True),
    ("true|mod(1,0)=1", True, True),
    ("false&mod(1,0)=1", False, False),
    ("b?1:mod(1,0)", 1, 1),
    ("true<=>false", False, False),
    ("b=true", True, True),
    ("b!=true", False, False),
    ("x=3.0", True, True),
    ("0.1+0.2=0.3", True, True),
    ("9007199254740993=9007199254740992.0", False, False),
    ("floor((0.1+0.7)*10)", 8, 8),
    ("ceil(3*0.1*10)", 3, 3),
    ("round(1.005*100-0.0000000000000001)", 100, 100),
    ("0.3-3*0.1", 0.0, Fraction(0)),
    ("1e-200*1e-200>0", True, True),
    ("1e200*1e200<1/0", True, True),
    ("log(x,3)>=1", True, True),
    ("log(x,2)*2>3.1699", True, True),
    ("floor(log(x,2)*1000000)", 1584962, 1584962),
    ("(1/4)^(1/2)", 0.5, Fraction(1, 2)),
    ("(8/27)^(-2/3)", 2.25, Fraction(9, 4)),
    ("log(8,4)", 1.5, Fraction(3, 2)),
    ("2^0.5*2^0.5<2.0000001&2^0.5>1.4142135623730950488", True, True),
    ("2.0^10000000>1e300", True, True),
    ("min(2^0.5,1.5)<max(log(3,2),1)", True, True),
    ("1/(0/-3)", math.inf, math.inf),
    ("1/min(0,0/-3)", math.inf, math.inf),
    ("1.5^2000", math.inf, Fraction(3, 2) ** 2000),
    ("(-1.5)^2001", -math.inf, Fraction(-3, 2) ** 2001),
]


@pytest.mark.parametrize(("text", "real", "exact"), VALUES)
def test_values(text: str, real: Value, exact: Value) -> None:
    expression, state = parse_expression(text), {"x": 3, "b": True}
    assert same(evaluate(expression, state), real)
    assert same(evaluate(expression, state, exact=True), exact)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("2^-1", "pow-negative"),
        ("pow(2,-1)", "pow-negative"),
        ("2^63", "int-overflow"),
        ("2^1000000000", "int-overflow"),
        ("9223372036854775807+1", "int-overflow"),
        ("-9223372036854775807-2", "int-overflow"),
        ("mod(1,0)", "mod-zero"),
        ("floor(1/0)", "not-integer"),
        ("round(0/0)", "not-integer"),
        ("ceil(1e30)", "int-overflow"),
    ],
)
@pytest.mark.parametrize("exact", [False, True])
def test_without_value(text: str, code: str, exact: bool) -> None:
    with pytest.raises(ModelFault) as caught:
        evaluate(parse_expression(text), {}, exact=exact)
    assert [d.code for d in caught.value.diagnostics] == [code]


@pytest.mark.parametrize(
    ("text", "code"),
    [("(1/2)^(1/2)", "exact-power"), ("log(3,2)", "exact-log"), ("2.0^10000000", "exact-power")],
)
def test_without_exact_value(text: str, code: str) -> None:
    with pytest.raises(ModelFault) as caught:
        evaluate(parse_expression(text), {}, exact=True)
    assert caught.value.diagnostics[0].code == code
    assert isinstance(evaluate(parse_expression(text), {}), float)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("text", ["log(3,2)*log(2,3)=1", "floor(2^0.5*2^0.5)", "(3^0.5)^2<=3"])
def test_what_enclosures_do_not_decide_is_an_error_with_its_place(text: str, exact: bool) -> None:
    with pytest.raises(ModelFault, match="digits do not decide") as caught:
        evaluate(parse_expression(text), {}, exact=exact)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "undecided"
    assert diagnostic.span.text in text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("max(2^0.5,2^0.5)", math.sqrt(2)),
        ("min(2^0.5*2^0.5,2)", 2.0),
        ("max(1,2^0.5)", math.sqrt(2)),
        ("min(1,2^0.5,3^0.5)", 1.0),
        ("floor(10*max(2^0.5,2^0.5,1))", 14),
    ],
)
def test_an_extreme_does_not_ask_which_of_equal_numbers_it_is(text: str, value: float) -> None:
    assert evaluate(parse_expression(text), {}) == pytest.approx(value, rel=1e-15)


def test_shared_operands_are_enclosed_once() -> None:
    """Each product asked its right operand twice: 2**40 enclosures of this tower."""
    text = "2^0.5"
    for _ in range(40):
        text = f"(1-3^0.5*{text}/2)"
    assert evaluate(parse_expression(f"{text} < 1e40"), {}) is True


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1-pow(0.999999,1000000)", -math.expm1(1e6 * math.log1p(-1e-6))),
        (
            "(1-pow(0.999999,100000))*0.5+(1-pow(0.999998,100000))*0.5",
            -sum(math.expm1(1e5 * math.log1p(x)) for x in (-1e-6, -2e-6)) / 2,
        ),
        ("pow(0.999999,1000000)<pow(0.999998,500001)", False),
        ("pow(0.9999,20000)=pow(pow(0.9999,2),10000)", True),
    ],
)
def test_powers_of_many_bits_are_enclosed_before_their_fractions_are_computed(
    text: str, value: Value, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sums of such fractions took seconds for each valuation; only equality needs them."""
    asked: list[int] = []
    power = Fraction.__pow__

    def counted(a: Fraction, b: int) -> Fraction:
        asked.append(abs(b))
        return power(a, b)

    monkeypatch.setattr(Fraction, "__pow__", counted)
    result = evaluate(parse_expression(text), {})
    assert result == (value if isinstance(value, bool) else pytest.approx(value, rel=1e-9))
    assert value is True or max(asked, default=0) < 1000


def test_limits_of_int_are_values() -> None:
    assert evaluate(parse_expression("-9223372036854775807-1"), {}) == -(2**63)
    assert evaluate(parse_expression("(-2)^63"), {}) == -(2**63)


def test_literals_beyond_the_ranges() -> None:
    with pytest.raises(ModelFault, match="64 bits"):
        evaluate(Literal(2**63, Type.INT), {})
    assert evaluate(Literal(Fraction(-(10**400)), Type.DOUBLE), {}) == -math.inf
    assert (
        evaluate(Literal(Fraction(1, 10**400), Type.DOUBLE), {}) == 5e-324
    )  # what is positive stays so


def test_roots_of_negative_numbers_and_zeros_without_sign() -> None:
    assert math.isnan(evaluate(parse_expression("(-1.0)^0.5"), {}))
    negative_zero = Unary(UnaryOperator.MINUS, Literal(Fraction(0), Type.DOUBLE))
    assert evaluate(negative_zero, {}) == 0
    assert evaluate(Binary(Operator.DIVIDE, Literal(1, Type.INT), negative_zero), {}) == math.inf
    for exponent in (-1, -2):
        power = Literal(Fraction(exponent), Type.DOUBLE)
        assert evaluate(Binary(Operator.POWER, negative_zero, power), {}) == math.inf


def test_names_without_value_and_labels() -> None:
    with pytest.raises(NameFault):
        evaluate(Name("x"), {})
    with pytest.raises(UnsupportedError, match="deadlock"):
        evaluate(LabelReference("deadlock"), {})


@pytest.mark.parametrize("operator", ["|", "+"])
def test_depth_does_not_matter(operator: str) -> None:
    one = Literal(False, Type.BOOL) if operator == "|" else Literal(1, Type.INT)
    left: Expression = one
    right: Expression = one
    for _ in range(20_000):
        left, right = (
            Binary(Operator(operator), left, one),
            Binary(Operator(operator), one, right),
        )
    for deep in (left, right):
        assert evaluate(deep, {}) == (False if operator == "|" else 20_001)


@given(anything, valuations, st.booleans())
def test_value_has_the_type(expression: Expression, state: dict[str, Value], exact: bool) -> None:
    try:
        value = evaluate(expression, state, exact=exact)
    except ModelFault:
        return
    assert type_of_value(value) is type_of(expression, TYPES)
    if exact:
        assert not isinstance(value, float) or not math.isfinite(value)
    else:
        assert not isinstance(value, Fraction)


@given(st.one_of(st.floats(), st.integers(-(2**63), 2**63 - 1), st.booleans(), st.fractions()))
def test_values_as_expressions(value: Value) -> None:
    expression = as_expression(value, type_of_value(value))
    assert same(evaluate(expression, {}, exact=isinstance(value, Fraction)), value)


@st.composite
def rationals(draw: st.DrawFn, depth: int = 4) -> tuple[Expression, Fraction]:
    """An expression of doubles and its exact value."""
    if depth == 0 or draw(st.booleans()):
        value = draw(st.fractions(-5, 5, max_denominator=7))
        return Literal(value, Type.DOUBLE), value
    (a, x), (b, y) = draw(rationals(depth - 1)), draw(rationals(depth - 1))
    operator = draw(st.sampled_from("+-*/"))
    if operator == "/" and y == 0:
        operator = "-"
    values = {"+": x + y, "-": x - y, "*": x * y, "/": x / y if y else x}
    return Binary(Operator(operator), a, b), values[operator]


@given(rationals())
def test_exact_arithmetic_is_that_of_fractions(pair: tuple[Expression, Fraction]) -> None:
    expression, value = pair
    assert same(evaluate(expression, {}, exact=True), value)
