"""Models built in Python are those of the texts that they print as."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck.errors import NameFault, SymcheckError, UsageError
from symcheck.exchange.python.builder import Expression
from symcheck.syntax.parse import parse_expression, parse_model

MODELS = Path(__file__).parents[2] / "models"


def office() -> symcheck.ModelBuilder:
    """The model of modelling/office.sm."""
    builder = symcheck.ModelBuilder("ctmc")
    places, pages = builder.constant("places", 4), builder.constant("pages", 0.5)
    repairs = builder.constant("repairs", 0.1)
    printer = builder.module("printer")
    queue, jammed = printer.integer("queue", 0, places, 0), printer.boolean("jammed", False)
    printer.command(queue < places, (pages, {queue: queue + 1}), action="send")
    printer.command((queue > 0) & ~jammed, (2, {queue: queue - 1}), action="print")
    printer.command((queue > 0) & ~jammed, (0.02, {jammed: True}))
    printer.command(jammed, (repairs, {jammed: False}), action="repair")
    technician = builder.module("technician")
    away = technician.boolean("away", False)
    technician.command(~away, (0.01, {away: True}))
    technician.command(away, (0.05, {away: False}))
    technician.command(~away, {}, action="repair")
    builder.label("full", queue == places)
    builder.state_reward("waiting", queue)
    builder.action_reward("pages", 1, "print")
    return builder


def test_a_model_with_modules_and_rewards_is_that_of_its_text() -> None:
    text = (MODELS / "modelling" / "office.sm").read_text(encoding="utf-8")
    assert office().program == parse_model(text)
    assert parse_model(str(office())) == parse_model(text)
    assert office().build().check('S=? [ "full" ]').value == pytest.approx(
        symcheck.loads(text).check('S=? [ "full" ]').value
    )


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda x, y: x + 2 * y - 1, "x + 2*y - 1"),
        (lambda x, y: x - (y - 1), "x - (y - 1)"),
        (lambda x, y: 1 - x, "1 - x"),
        (lambda x, y: -x * (y + 1), "-x*(y + 1)"),
        (lambda x, y: (x < y) & ~(x == 0) | (y != 3), "x<y & !x=0 | y!=3"),
        (lambda x, y: True & (x >= y), "true & x>=y"),
        (lambda x, y: x % 2 + y**2, "mod(x, 2) + pow(y, 2)"),
        (lambda x, y: 1 / x, "1/x"),
        (lambda x, y: x // 2 + 5 // y, "floor(x/2) + floor(5/y)"),
        (lambda x, y: 5 % x + 2**y, "mod(5, x) + pow(2, y)"),
        (lambda x, y: x * Fraction(1, 3), "x*(1.0/3.0)"),
        (lambda x, y: x * -0.25, "x*-0.25"),
        (lambda x, y: x + np.int64(3), "x + 3"),
        (lambda x, y: symcheck.ModelBuilder.choose(x <= y, x, y), "x<=y ? x : y"),
        (lambda x, y: symcheck.ModelBuilder.min(x, y, 3), "min(x, y, 3)"),
        (lambda x, y: symcheck.ModelBuilder.floor(x / y), "floor(x/y)"),
    ],
)
def test_operators_of_python_are_those_of_the_language(made: object, text: str) -> None:
    builder = symcheck.ModelBuilder("dtmc")
    expression: Expression = made(builder.integer("x", 0, 3), builder.integer("y", 0, 3))  # type: ignore[operator]
    assert str(expression) == text
    assert symcheck.pretty(parse_expression(text)) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-3, "int c = -3"),
        (-0.5, "double c = -0.5"),
        (True, "bool c = true"),
        (2.0, "double c = 2.0"),
    ],
)
def test_a_constant_has_the_type_of_its_value(value: object, text: str) -> None:
    builder = symcheck.ModelBuilder("dtmc")
    builder.constant("c", value)
    assert f"const {text};" in str(builder)


def test_constants_are_given_when_the_model_is_built() -> None:
    builder = symcheck.ModelBuilder("dtmc")
    p, n = builder.constant("p", type="double"), builder.constant("n", type="int")
    m = builder.module("m")
    x = m.integer("x", 0, n)
    m.command(x < n, (p, {x: x + 1}), (1 - p, {}))
    for engine in ("explicit", "exact"):
        model = builder.build("n=4,p=0.25", engine=engine)
        assert model.check("T=? [ F x=n ]").value == pytest.approx(16)


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        (lambda b, x: b.constant("c"), UsageError, "constant c: give its type"),
        (lambda b, x: b.constant("c", x + 1), UsageError, "constant c: give its type"),
        (lambda b, x: b.constant("c", type="real"), UsageError, "constant c: give its type"),
        (lambda b, x: b.module("m").integer("y", 0, None), UsageError, "give both bounds"),
        (lambda b, x: b.module("a b"), NameFault, "'a b' cannot be the name of a module"),
        (lambda b, x: b.module("module"), NameFault, "'module' is a reserved word"),
        (lambda b, x: b.label("init", x > 0), NameFault, "predefined"),
        (lambda b, x: b.module("m").command(True, (0.5, {x: 1}, 1)), UsageError, "a pair"),
        (lambda b, x: symcheck.ModelBuilder("pomdp"), UsageError, "such a model needs a text"),
        (lambda b, x: symcheck.ModelBuilder("ma"), UsageError, "nothing tells rates from"),
        (lambda b, x: b.action_reward("r", 1, "a b"), NameFault, "'a b' cannot be the name"),
        (lambda b, x: b.label("l", "x>0"), UsageError, "expected an expression or a finite number"),
        (lambda b, x: b.label("l", float("inf")), UsageError, "not inf"),
        (lambda b, x: b.module("m").command(x > 0), UsageError, "at least one update"),
        (lambda b, x: b.module("m").command(x > 0, {"x": 1}), UsageError, "a variable, not 'x'"),
        (lambda b, x: b.module("m").command(x > 0, (0.5, 1)), UsageError, "a mapping"),
        (lambda b, x: symcheck.ModelBuilder("nfa"), SymcheckError, "nfa"),
        (lambda b, x: (b.label("l", x + 1), b.build()), SymcheckError, "l"),
    ],
)
def test_errors_of_a_builder(wrong: object, error: type[Exception], message: str) -> None:
    builder = symcheck.ModelBuilder("dtmc")
    with pytest.raises(error) as caught:
        wrong(builder, builder.integer("x", 0, 3))  # type: ignore[operator]
    assert message in str(caught.value)


def test_an_expression_has_no_truth_value() -> None:
    x = symcheck.ModelBuilder("dtmc").integer("x", 0, 3)
    with pytest.raises(TypeError, match=r"write & \| ~ for"):
        assert 0 < x < 3
