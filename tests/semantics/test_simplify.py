from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semantics.expressions import TYPES, anything, valuations
from semantics.test_evaluate import same
from symcheck.errors import ModelFault
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.model import Value
from symcheck.syntax.ast import Expression, Literal
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.traversal import nodes


@given(anything, valuations, st.booleans(), st.booleans())
def test_folding_changes_no_value(
    expression: Expression, state: dict[str, Value], exact: bool, typed: bool
) -> None:
    folded = simplify(expression, types=TYPES if typed else None)
    assert type_of(folded, TYPES) is type_of(expression, TYPES)
    try:
        value = evaluate(expression, state, exact=exact)
    except ModelFault:
        return
    assert same(evaluate(folded, state, exact=exact), value)


@given(anything)
def test_folding_twice_changes_nothing(expression: Expression) -> None:
    once = simplify(expression, types=TYPES)
    assert simplify(once, types=TYPES) == once


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("1+2*3", "7"),
        ("x+(2-1)", "x+1"),
        ("x>0 & 1<2", "x>0"),
        ("1>2 & x>0", "false"),
        ("x>0 | 1<2", "true"),
        ("1>2 | x>0", "x>0"),
        ("1<2 => x>0", "x>0"),
        ("1>2 => x>0", "true"),
        ("1<2 ? x : y", "x"),
        ("1<2 ? x : 0.5", "true ? x : 0.5"),
        ("1<2 ? 1 : 0.5", "1.0"),
        ("1<2 ? 0.5 : x", "0.5"),
        ("x*0", "x*0"),
        ("1/0", "1/0"),
        ("mod(1,0)", "mod(1,0)"),
        ("P>=1-0.5 [ F<=2*3 true & b ]", "P>=0.5 [ F<=6 b ]"),
    ],
)
def test_forms(text: str, result: str) -> None:
    assert simplify(parse_expression(text), types=TYPES) == parse_expression(result)


def test_without_types_an_unknown_branch_stays() -> None:
    assert simplify(parse_expression("true ? x : y")) == parse_expression("true ? x : y")


@pytest.mark.parametrize(
    ("text", "result"),
    [("0.1+0.2=0.3", "true"), ("0.1*3", "0.3"), ("2^0.5", "2^0.5"), ("0.99^2000", "0.99^2000")],
)
def test_constants_are_folded_to_short_exact_values_only(text: str, result: str) -> None:
    assert simplify(parse_expression(text)) == parse_expression(result)


def test_deep_expressions() -> None:
    deep = parse_expression(" | ".join(["x=1"] * 1900 + ["true"]))
    assert [type(n) for n in nodes(simplify(deep))] == [Literal]
