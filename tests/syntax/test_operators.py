"""The table of operators and functions is what parser, printer, types and evaluators read."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from kernels.columns import run_masked
from symcheck.errors import TypeFault
from symcheck.explicit.compile import compile_expression
from symcheck.semantics.expressions import evaluate, vectorised
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.expressions.types import static_type, type_of
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Binary, Call, Literal, Name, Type
from symcheck.syntax.operators import Function, Operator, Signature, complete, connect
from symcheck.syntax.parse import parse_expression, parse_properties
from symcheck.syntax.printer import pretty
from syntax.operations import APPLICATIONS, applied

LOGICAL = [o for o in Operator if o.is_logical]
BOOLS = (False, True)
VARIABLES = tuple(Variable(n, Type.BOOL, 0, 1, False, "m") for n in "ab")


def test_a_table_names_the_operators_that_it_lacks():
    with pytest.raises(TypeError, match="no meaning for min, log"):
        complete({Function.MAX: 1}, [Function.MIN, Function.MAX, Function.LOG])


@pytest.mark.parametrize("operation", [*Operator, *Function])
def test_both_languages_read_every_operation(operation):
    count = 2 if isinstance(operation, Operator) else operation.arity or 3
    text = pretty(applied(operation, *(Name(n) for n in "abc"[:count])))
    assert pretty(parse_expression(text)) == text
    (formula,) = parse_properties(text).properties
    assert pretty(formula.formula) == text
    if isinstance(operation, Function) and operation not in (Function.MIN, Function.MAX):
        assert parse_expression(operation) == Name(operation)


def test_a_logical_operator_has_a_truth_table_and_the_others_have_none():
    assert all((o.truth is not None) is o.is_logical for o in Operator)


@pytest.mark.parametrize("operator", LOGICAL)
def test_the_meanings_of_a_logical_operator_are_its_truth_table(operator):
    a, b = (np.array(column) for column in zip(*product(BOOLS, BOOLS), strict=True))
    expression = Binary(operator, Name("a"), Name("b"))
    truth = list(operator.truth)
    scalar = [evaluate.evaluate(expression, {"a": x, "b": y}) for x, y in product(BOOLS, BOOLS)]
    assert scalar == truth
    assert vectorised.evaluate_columns(expression, {"a": a, "b": b}).values.tolist() == truth
    assert run_masked(compile_expression(expression, VARIABLES), {0: a, 1: b})[0].tolist() == truth
    assert connect(operator, a, b).tolist() == truth
    for value in BOOLS:
        literal = Literal(value, Type.BOOL)
        for x in BOOLS:
            for folded, expected in (
                (simplify(Binary(operator, literal, Name("a"))), operator.apply(value, x)),
                (simplify(Binary(operator, Name("a"), literal)), operator.apply(x, value)),
            ):
                assert evaluate.evaluate(folded, {"a": x}) is expected


@pytest.mark.parametrize("outer", Operator)
@pytest.mark.parametrize("inner", Operator)
def test_the_printer_and_the_parser_agree_on_precedence(outer, inner):
    a, b, c = (Name(n) for n in "abc")
    for tree in (Binary(outer, Binary(inner, a, b), c), Binary(outer, a, Binary(inner, b, c))):
        assert parse_expression(pretty(tree)) == tree
    flat = parse_expression(f"a {outer.value} b {inner.value} c")
    right = inner.precedence > outer.precedence or inner is outer is Operator.IMPLIES
    assert flat == (
        Binary(outer, a, Binary(inner, b, c)) if right else Binary(inner, Binary(outer, a, b), c)
    )


@pytest.mark.parametrize(("function", "count"), [a for a in APPLICATIONS if a[0] in Function])
def test_functions_are_parsed_and_typed(function, count):
    tree = Call(function, tuple(Literal(i, Type.INT) for i in range(2, 2 + count)))
    assert parse_expression(pretty(tree)) == tree
    kind = type_of(tree, {})
    assert kind is (Type.DOUBLE if function.signature is Signature.DIVISION else Type.INT)
    assert static_type(tree, {}.__getitem__) is kind


@pytest.mark.parametrize("function", Function)
def test_functions_say_how_many_arguments_they_take(function):
    for count in (0, 4) if function.arity else (0,):
        tree = Call(function, (Literal(1, Type.INT),) * count)
        with pytest.raises(
            TypeFault, match=f"{function} takes {function.arity or 'at least 1'} arg"
        ):
            type_of(tree, {})
