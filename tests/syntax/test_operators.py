"""The operators and functions have an entry in the tables of every package that needs one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from kernels.columns import run_masked
from symcheck.explicit import code_generation
from symcheck.explicit.compile import compile_expression
from symcheck.semantics.expressions import evaluate, vectorised
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Binary, Call, Literal, Name, Type
from symcheck.syntax.operators import Function, Operator, connect
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.printer import pretty

LOGICAL = [o for o in Operator if o.is_logical]
OTHERS = {o for o in Operator if not o.is_logical}
MEANINGS = {
    "scalar": evaluate.BINARY,
    "compiled": {**code_generation.ARITHMETIC, **code_generation.COMPARISONS},
}
FUNCTIONS = {
    "scalar": evaluate.FUNCTIONS,
    "compiled": code_generation.FUNCTIONS,
}
BOOLS = (False, True)
VARIABLES = tuple(Variable(n, Type.BOOL, 0, 1, False, "m") for n in "ab")


@pytest.mark.parametrize("table", MEANINGS)
def test_every_operator_has_a_meaning(table):
    assert set(MEANINGS[table]) == OTHERS


@pytest.mark.parametrize("table", FUNCTIONS)
def test_every_function_has_a_meaning(table):
    assert set(FUNCTIONS[table]) == set(Function)


@pytest.mark.parametrize("operation", [*sorted(OTHERS), *Function])
@pytest.mark.parametrize("operand", ["x", "x*0.5"])
def test_every_operation_is_vectorised(operation, operand):
    if operation is Function.MOD and operand != "x":
        return
    count = 1 if operation in (Function.FLOOR, Function.CEIL, Function.ROUND) else 2
    operands = (parse_expression(operand),) * count
    is_call = isinstance(operation, Function)
    expression = Call(operation, operands) if is_call else Binary(operation, *operands)
    lanes = vectorised.evaluate_columns(expression, {"x": np.array([1, 3])})
    values = [evaluate.evaluate(expression, {"x": x}) for x in (1, 3)]
    assert lanes.faults is None
    np.testing.assert_array_equal(lanes.values, values)


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


@pytest.mark.parametrize("function", Function)
def test_functions_are_parsed_and_typed(function):
    arguments = tuple(Literal(i, Type.INT) for i in range(2, 2 + (function.arity or 3)))
    tree = Call(function, arguments)
    assert parse_expression(pretty(tree)) == tree
    expected = Type.DOUBLE if function is Function.LOG else Type.INT
    assert type_of(tree, {}) is expected
