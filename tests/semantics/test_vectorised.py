"""The vectorised evaluator agrees with the scalar one, lane by lane."""

from __future__ import annotations

import math
import re
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings

from semantics.expressions import anything
from symcheck.errors import InputError
from symcheck.semantics.expressions import vectorised
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.syntax.ast import (
    Binary,
    Call,
    LabelReference,
    Literal,
    Name,
    Type,
)
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.parse import parse_expression


@settings(max_examples=300, deadline=None)
@given(anything)
def test_agrees_with_the_scalar_evaluator(expression):
    x, y, b = np.arange(-2, 4), np.arange(0, 3), np.array([False, True])
    columns = {"x": x.reshape(-1, 1, 1), "y": y.reshape(1, -1, 1), "b": b.reshape(1, 1, -1)}
    lanes = evaluate_columns(expression, columns)
    values = np.broadcast_to(lanes.values, (6, 3, 2))
    faults = np.broadcast_to(False if lanes.faults is None else lanes.faults, (6, 3, 2))
    for (i, j, k), value in np.ndenumerate(values):
        try:
            expected = evaluate(expression, {"x": int(x[i]), "y": int(y[j]), "b": bool(b[k])})
        except InputError:
            assert faults[i, j, k]
            continue
        assert not faults[i, j, k]
        if isinstance(expected, float) and math.isnan(expected):
            assert np.isnan(value)
        elif isinstance(expected, float):
            assert value == pytest.approx(expected, rel=1e-13, abs=1e-300)
        else:
            assert value == expected


@pytest.mark.parametrize(
    "expression",
    [
        Call(Function.MOD, (Name("x"), Literal(0, Type.INT))),
        Call(Function.POW, (Literal(2, Type.INT), Literal(-1, Type.INT))),
        Call(
            Function.FLOOR, (Binary(Operator.DIVIDE, Literal(1, Type.INT), Literal(0, Type.INT)),)
        ),
        Binary(Operator.POWER, Literal(10, Type.INT), Literal(30, Type.INT)),
    ],
)
def test_what_has_no_integer_value_is_a_fault(expression):
    with pytest.raises(InputError):
        evaluate(expression, {"x": 3})
    lanes = evaluate_columns(expression, {"x": np.array([3, 4])})
    assert lanes.faults is not None
    assert lanes.faults.all()
    assert np.isnan(lanes.numbers()).all()


def test_lanes_that_have_a_value_keep_it():
    x = np.array([0, 1, 2])
    quotient = Call(Function.FLOOR, (Binary(Operator.DIVIDE, Literal(6, Type.INT), Name("x")),))
    assert evaluate_columns(quotient, {"x": x}).values[1:].tolist() == [6, 3]
    remainder = evaluate_columns(Call(Function.MOD, (Literal(7, Type.INT), Name("x"))), {"x": x})
    assert remainder.faults is not None
    assert remainder.faults.tolist() == [True, False, False]
    assert remainder.values[1:].tolist() == [0, 1]


def test_only_the_variables_that_occur_give_the_shape():
    columns = {"x": np.arange(4).reshape(4, 1), "y": np.arange(3).reshape(1, 3)}
    assert evaluate_columns(Name("y"), columns).values.shape == (1, 3)
    assert evaluate_columns(Literal(1, Type.INT), columns).values.shape == ()
    assert evaluate_columns(
        Binary(Operator.PLUS, Name("x"), Name("y")), columns
    ).values.tolist() == [[i + j for j in range(3)] for i in range(4)]


def test_temporal_nodes_are_refused():
    with pytest.raises(TypeError, match="LabelReference"):
        evaluate_columns(LabelReference("done"), {})


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize("operator", ["<", "<=", "=", "!=", ">=", ">"])
@pytest.mark.parametrize("offset", [-1, 0, 1, 2, 3, 5])
def test_a_large_int_is_compared_as_it_is_and_not_as_its_double(
    sign: str, operator: str, offset: int
) -> None:
    whole = f"{sign}(x + {2**53 + offset})"
    for threshold in (2**53, 2**53 + 4):
        condition = parse_expression(f"{whole} + 0.0 {operator} {sign}{threshold}.0")
        found = evaluate_columns(condition, {"x": np.array([0])})
        assert found.values.item() == evaluate(condition, {"x": 0}), condition


@pytest.mark.parametrize(
    "text",
    [
        "pow((x+1)/21,y/20)",
        "pow(x+1,y/20)",
        "pow((x+1)/21,y)",
        "log((x+2)/3,y+2)",
        "log(x+2,(y+11)/10)",
        "log((x+1)/7,(y+11)/7)",
        "1-pow(pow(0.9,x+1),pow(0.8,y))",
    ],
)
def test_bounds_of_powers_and_logarithms_hold_and_suffice(text, monkeypatch):
    """Powers and logarithms of rounded numbers are left to the scalar evaluator where they cancel
    only: a table over two variables of 21 values asked it 441 times for each of them.

    (The last one cancels more than three bits nearly everywhere.)"""
    asked = []

    def count(expression, valuation, **options):
        asked.append(valuation)
        return evaluate(expression, valuation, **options)

    monkeypatch.setattr(vectorised, "evaluate", count)
    expression = parse_expression(text)
    x, y = np.arange(21)[:, None], np.arange(21)[None, :]
    lanes = evaluate_columns(expression, {"x": x, "y": y})
    assert len(asked) <= (380 if text.startswith("1-pow") else 160)
    for i, j in ((0, 0), (0, 20), (20, 0), (19, 13), (5, 7), (3, 1), (6, 20)):
        with localcontext(prec=60):
            real = _high_precision(text, i, j)
            distance = abs(Decimal(float(lanes.values[i, j])) - real)
            assert distance <= Decimal(float(np.broadcast_to(lanes.errors, (21, 21))[i, j])), (i, j)


def _high_precision(text, x, y):
    """The value in 60 digits: Python evaluates the text on decimals."""
    names = {
        "pow": lambda a, b: a**b if b else Decimal(1),
        "log": lambda a, b: a.ln() / b.ln(),
        "x": Decimal(x),
        "y": Decimal(y),
    }
    return eval(re.sub(r"(\d+(\.\d+)?)", r"D('\1')", text), {"D": Decimal, **names})
