"""The register machine against the scalar evaluation, on random well-typed expressions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernels.columns import run_masked
from semantics.expressions import BOOLS, typed
from symcheck.errors import ModelFault
from symcheck.explicit.compile import compile_expression
from symcheck.explicit.states import StateLayout
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type
from symcheck.syntax.operators import Function, Operator

VARIABLES = (
    Variable("x", Type.INT, -3, 4, 0, "m"),
    Variable("y", Type.INT, 0, 7, 0, "m"),
    Variable("b", Type.BOOL, 0, 1, False, "m"),
    Variable("z", Type.INT, None, None, 0, None),
    Variable("c", Type.BOOL, 0, 1, False, None),
)

_INTS = st.one_of(
    st.integers(-4, 9).map(lambda v: Literal(v, Type.INT)),
    st.sampled_from([Name("x"), Name("y"), Name("z")]),
    st.sampled_from([2**31, 2**62, -(2**62)]).map(lambda v: Literal(v, Type.INT)),
)
_BOOLS = st.one_of(BOOLS, st.just(Name("c")))
EXPRESSIONS = st.one_of(*typed(3, _INTS, b=_BOOLS).values())
STATES = st.tuples(
    st.integers(-3, 4),
    st.integers(0, 7),
    st.booleans(),
    st.sampled_from([-(2**31), -1, 0, 5, 2**31 - 1]),
    st.booleans(),
)


def _same(a, b) -> bool:
    if isinstance(b, float):
        return (math.isnan(a) and math.isnan(b)) or (
            a == b and math.copysign(1, a) == math.copysign(1, b)
        )
    return type(a) is type(b) and a == b


@settings(max_examples=1500, deadline=None)
@given(EXPRESSIONS, st.lists(STATES, min_size=1, max_size=8))
def test_machine_agrees_with_scalar_evaluation(expression: Expression, states):
    code = compile_expression(expression, VARIABLES)
    columns = dict(enumerate(np.array(states, np.int64).T))
    values, valid = run_masked(code, columns)
    for k, state in enumerate(states):
        valuation = {v.name: value for v, value in zip(VARIABLES, state, strict=True)}
        try:
            expected = evaluate(expression, valuation)
        except ModelFault:
            assert not valid[k], expression
        else:
            assert valid[k], expression
            assert _same(values[k].item(), expected), (expression, state)


def test_a_lane_without_value_raises_the_scalar_fault():
    code = compile_expression(Call(Function.MOD, (Literal(5, Type.INT), Name("y"))), VARIABLES)
    layout = StateLayout.of(VARIABLES)
    column, zeros = np.array([2, 1, 0]), np.zeros(3, np.int64)
    with pytest.raises(ModelFault, match="mod"):
        code.run_packed(layout, layout.pack([zeros, column, zeros, zeros, zeros]))
    values, valid = run_masked(code, {1: column})
    assert values[:2].tolist() == [1, 0]
    assert valid.tolist() == [True, True, False]


def test_support_and_type():
    code = compile_expression(
        Conditional(Name("b"), Name("x"), Literal(Fraction(1, 2), Type.DOUBLE)), VARIABLES
    )
    assert code.support == (0, 2)
    assert code.type is Type.DOUBLE
    assert run_masked(code, {0: np.array([3, 3]), 2: np.array([1, 0])})[0].tolist() == [3.0, 0.5]
    assert (
        compile_expression(
            Binary(Operator.PLUS, Literal(1, Type.INT), Literal(2, Type.INT)), VARIABLES
        ).support
        == ()
    )


def test_what_protects_an_operand_is_kept():
    divides = Binary(Operator.EQ, Call(Function.MOD, (Name("x"), Name("y"))), Literal(0, Type.INT))
    guarded = Binary(Operator.AND, Binary(Operator.GT, Name("y"), Literal(0, Type.INT)), divides)
    code = compile_expression(guarded, VARIABLES)
    values, valid = run_masked(code, {0: np.array([4, 4, 3]), 1: np.array([0, 2, 2])})
    assert values.tolist() == [False, True, False]
    assert valid.all()


def test_shared_parts_are_computed_once():
    part = Binary(Operator.TIMES, Name("x"), Name("y"))
    once = compile_expression(part, VARIABLES)
    both = compile_expression(Binary(Operator.PLUS, part, part), VARIABLES)
    assert len(both.program) == len(once.program) + 1
