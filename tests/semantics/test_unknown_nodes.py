"""Nothing passes silently: an operator or a state operator that the code does not know is named, or taken for the worst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from kernels.columns import run_masked
from symcheck.check.context import Context
from symcheck.check.state_formulas import is_plain, satisfying, values_of
from symcheck.errors import UnsupportedError
from symcheck.explicit.compile import compile_expression
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.expressions.types import Typer
from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.semantics.model import Variable
from symcheck.semantics.path_normal_form import StateFormula, normal_form
from symcheck.semantics.query import query_of
from symcheck.semantics.reduction.live_variables import may_be_undefined
from symcheck.syntax.ast import (
    Binary,
    Expression,
    Literal,
    Name,
    Node,
    RewardOperator,
    StateOperator,
    Type,
)
from symcheck.syntax.operators import Operator, Signature, connect
from symcheck.syntax.parse import parse_model
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import reads_rewards

VARIABLES = (
    Variable("a", Type.BOOL, 0, 1, False, "m"),
    Variable("b", Type.BOOL, 0, 1, False, "m"),
    Variable("x", Type.INT, 0, 3, 0, "m"),
)


@dataclass(frozen=True, slots=True)
class Dummy(StateOperator):
    """A state operator of which no code knows."""

    formula: Expression


def operator(token: str, signature: Signature, truth: str | None = None) -> Operator:
    """An operator that is no member of the table."""
    made = str.__new__(Operator, token)
    made._name_ = made._value_ = token
    made.precedence, made.signature = 2, signature
    made.truth = None if truth is None else tuple(t == "t" for t in truth)
    return made


@dataclass(frozen=True, slots=True)
class DummyQuery(Node):
    """A reward query of which no code knows."""


DUMMY = Dummy(Literal(True, Type.BOOL))
CONTEXT = Context(None, Options())
MODEL = bind(parse_model("dtmc module m a : bool; [] true -> true; endmodule"))
X = Name("x")


@pytest.mark.parametrize(
    "ask",
    [
        pretty,
        lambda node: evaluate(node, {}),
        lambda node: evaluate_columns(node, {}),
        lambda node: compile_expression(node, VARIABLES),
        lambda node: Typer(DiagnosticCollector(), lambda _: None, lambda _: None).state(node),
        lambda node: satisfying(CONTEXT, node, None),
        lambda node: values_of(CONTEXT, node, None),
    ],
)
def test_an_unknown_state_operator_is_named(ask) -> None:
    with pytest.raises((AssertionError, TypeError, UnsupportedError), match="Dummy"):
        ask(DUMMY)


def test_an_unknown_reward_query_is_named() -> None:
    with pytest.raises(AssertionError, match="DummyQuery"):
        query_of(RewardOperator(None, None, None, DummyQuery()), MODEL)


def test_an_unknown_state_operator_is_taken_for_the_worst() -> None:
    assert reads_rewards(DUMMY)
    assert not is_plain(DUMMY)
    assert normal_form(DUMMY, None) == StateFormula(DUMMY)


def test_an_unknown_operator_of_numbers_is_named() -> None:
    node = Binary(operator("%", Signature.ARITHMETIC), X, Literal(2, Type.INT))
    assert may_be_undefined(node)
    with pytest.raises(KeyError, match="%"):
        evaluate(node, {"x": 1})
    with pytest.raises(KeyError, match="%"):
        evaluate_columns(node, {"x": np.array([1])})
    with pytest.raises(KeyError, match="%"):
        compile_expression(node, VARIABLES)


def test_a_new_logical_operator_needs_a_truth_table_only() -> None:
    xor = operator("xor", Signature.LOGICAL, "fttf")
    node = Binary(xor, Name("a"), Name("b"))
    a, b = np.array([0, 0, 1, 1], bool), np.array([0, 1, 0, 1], bool)
    expected = [False, True, True, False]
    scalar = [evaluate(node, {"a": bool(x), "b": bool(y)}) for x, y in zip(a, b, strict=True)]
    assert scalar == expected
    assert evaluate_columns(node, {"a": a, "b": b}).values.tolist() == expected
    assert run_masked(compile_expression(node, VARIABLES), {0: a, 1: b})[0].tolist() == expected
    assert connect(xor, a, b).tolist() == expected
    assert pretty(node) == "a xor b"
    assert simplify(Binary(xor, Literal(True, Type.BOOL), Name("a"))) == simplify(
        Binary(xor, Name("a"), Literal(True, Type.BOOL))
    )
