"""All evaluators of expressions agree on every operator, for zeros, large ints, infinities and NaN.

The scalar evaluator is the reference; a table of its values at the points where tools differ states the language.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

import symcheck
from kernels.columns import run_masked
from symbolic.oracle import at
from symcheck.errors import InputError
from symcheck.explicit.compile import compile_expression
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.semantics.model import Value
from symcheck.symbolic.build import build
from symcheck.symbolic.model import StateSpace
from symcheck.symbolic.tuning import EncodingLimits
from symcheck.syntax.ast import Expression, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator, Signature, UnaryOperator
from symcheck.syntax.parse import parse_expression, parse_model
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import nodes
from syntax.operations import NUMERIC, applied

MODEL = bind(parse_model("dtmc module m x : [-1..1]; [] true -> true; endmodule"))
STATES = (-1, 0, 1)
POWERS = [2**31, 2**53 + 1, -(2**53) - 1, 2**62, 2**63 - 1, -(2**63) + 1]
INTS = ["x", "0", "-2", "3", *map(str, POWERS), "(-9223372036854775807-1)"]
DOUBLES = [
    *("-0.0", "x/-3", "(0.0*x)", "1/0", "-1/0", "0/0", "x/0", "0.5", "-2.5", "1.0", "4503599627370495.5"),
    *("0.49999999999999994", "-0.49999999999999994", "9223372036854775807.0", "9223372036854774784.0", "1e308", "5e-324"),
]  # fmt: skip
WAYS = {
    "tabulated": EncodingLimits(),
    "composed": EncodingLimits(table_bits=0),
    "on the fly": EncodingLimits(table_bits=0, wide_table_bits=0, max_nodes=0, max_leaves=0),
}
FEW = ["x", "3", "x/0", "-0.0", "9007199254740993"]
"""Operands of which there are so many combinations that all are taken of three."""


def expressions(operator: UnaryOperator | Operator | Function, count: int) -> list[Expression]:
    """An operator applied to all combinations of special values."""
    texts = [*INTS, *DOUBLES] if count < 3 else FEW
    if not isinstance(operator, UnaryOperator) and operator.signature is Signature.INTEGER:
        texts = [text for text in texts if text in INTS]
    values = [parse_expression(text) for text in texts]
    if isinstance(operator, UnaryOperator):
        return [Unary(operator, v) for v in values]
    return [applied(operator, *operands) for operands in product(values, repeat=count)]


def scalar(expression, x: int) -> Value | None:
    try:
        return evaluate(expression, {"x": x})
    except InputError:
        return None


def at_states(expression: Expression) -> list[Value | None]:
    """The value at each state; one that does not depend on the state is computed once."""
    if any(isinstance(node, Name) for node in nodes(expression)):
        return [scalar(expression, x) for x in STATES]
    return [scalar(expression, 0)] * len(STATES)


def key(value: Value | None) -> tuple[str, object]:
    """Equal for equal values of one type, doubles up to rounding; NaN equals itself."""
    if isinstance(value, float):
        return "float", pytest.approx(value, rel=1e-11, abs=0, nan_ok=True)
    return type(value).__name__, value


@pytest.mark.parametrize(("operator", "count"), [(UnaryOperator.MINUS, 1), *NUMERIC])
def test_evaluators_agree(operator: UnaryOperator | Operator | Function, count: int) -> None:
    columns = {"x": np.array(STATES, np.int64)}
    for expression in expressions(operator, count):
        expected = [key(value) for value in at_states(expression)]

        simplified = simplify(expression, types={"x": Type.INT})
        assert [key(value) for value in at_states(simplified)] == expected, pretty(expression)

        lanes = evaluate_columns(expression, columns).spread((len(STATES),))
        faults = [False] * len(STATES) if lanes.faults is None else lanes.faults
        values = zip(faults, lanes.values.tolist(), strict=True)
        assert [key(None if fault else value) for fault, value in values] == expected, pretty(
            expression
        )

        code = compile_expression(expression, MODEL)
        found, valid = (
            np.broadcast_to(a, len(STATES)) for a in run_masked(code, {0: columns["x"]})
        )
        values = zip(valid, found.tolist(), strict=True)
        assert [key(value if ok else None) for ok, value in values] == expected, pretty(expression)


@pytest.mark.parametrize(("operator", "count"), [a for a in NUMERIC if a[0].is_total])
def test_what_is_total_has_finite_values_for_finite_operands(
    operator: Operator | Function, count: int
) -> None:
    texts = ["0", "3", "-2", "x", "0.0", "0.5", "-2.5"]
    whole = operator.signature is Signature.INTEGER
    values = [parse_expression(text) for text in texts if not (whole and "." in text)]
    for operands in product(values, repeat=count):
        expression = applied(operator, *operands)
        assert math.isfinite(evaluate(expression, {"x": -1})), pretty(expression)


@pytest.mark.parametrize("way", WAYS)
def test_diagrams_agree(way: str) -> None:
    symbolic = build(MODEL, Options(), limits=WAYS[way])
    everything = symbolic.translator.valid(symbolic.encoding.variables[0])
    space = StateSpace(symbolic, everything, symbolic.manager.false, 3, "none", 0.0, ())
    texts = ["x", "x/-3", "x/0", "-0.0", "9007199254740993"]
    values = [parse_expression(text) for text in texts]
    shapes = ["1/min({}, {})", "1/max({}, {})", "({} < {} ? 0/x : 1)", "pow({}, {}) * 0"]
    combinations = [
        *(parse_expression(s.format(a, b)) for s in shapes for a, b in product(texts, texts)),
        *(
            applied(operation, *operands)
            for operation, count in NUMERIC
            for operands in product(values, repeat=count)
            if operation.signature is not Signature.INTEGER
            or all(values.index(o) in (0, 4) for o in operands)
        ),
    ]
    for expression in combinations:
        text = pretty(expression)
        translator = symbolic.translator
        if compile_expression(expression, MODEL).type is Type.BOOL:
            diagram, undefined = (
                translator.boolean_on(expression, everything),
                symbolic.manager.false,
            )
        else:
            diagram = translator.number_on(expression, everything)
            undefined = translator.undefined(expression)
        faults = translator.faults(expression)
        for x in STATES:
            value = scalar(expression, x)
            assert at(space, faults, (x,)) == (value is None), text
            if value is not None:
                is_nan = isinstance(value, float) and math.isnan(value)
                assert at(space, undefined, (x,)) == is_nan, text
                assert is_nan or at(space, diagram, (x,)) == pytest.approx(
                    float(value), rel=1e-9, abs=0
                ), text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 / min(0.0, -0.0)", math.inf),
        ("1 / min(-0.0, 0.0)", math.inf),
        ("1 / max(0.0, -0.0)", math.inf),
        ("1 / max(-0.0, 0.0)", math.inf),
        ("1 / min(0, 0 / -3)", math.inf),
        ("1 / min(0.0, 3, -0.0)", math.inf),
        ("1 / (0 * -1)", math.inf),
        ("1 / (0.0 * -1)", math.inf),
        ("1 / (-0.0 + 0.0)", math.inf),
        ("1 / floor(-0.0)", math.inf),
        ("1 / -(0/1)", math.inf),
        ("1 / log(1, 0.5)", math.inf),
        ("-0.0 ^ -1", math.inf),  # a minus binds tighter than a power
        ("-0.0 ^ -2", math.inf),
        ("0.0 = -0.0", True),
        ("0.0 < -0.0", False),
        ("round(0.49999999999999994)", 0),
        ("round(4503599627370497.0)", 4503599627370497),
        ("round(-2.5)", -2),
        ("9007199254740993 = 9007199254740992.0", False),
        ("max(9007199254740993, 1.0) = 9007199254740993", True),
        ("pow(0/0, 0)", 1.0),
    ],
)  # fmt: skip
def test_the_language(text: str, expected: Value) -> None:
    assert key(scalar(parse_expression(text), 0)) == key(expected)
    exact = evaluate(parse_expression(text), {}, exact=True)
    assert key(float(exact) if isinstance(expected, float) else exact) == key(expected)


@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "hybrid", "exact"])
def test_zeros_of_property_values_have_no_sign(engine: str, tmp_path) -> None:
    file = tmp_path / "m.pm"
    file.write_text("dtmc module m x : [0..1]; [] true -> (x'=1); endmodule")
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    model = symcheck.load(file, **options)
    never = "(P=? [ F x=7 ])"
    for text, expected in {
        f"1/min(0, {never}/-3)": math.inf,
        f"{never}/-3": 0,
        "x/-3": 0,
        f"min(0/{never}, 1)": math.nan,
        f"max(1, 0/{never})": math.nan,
        f"floor(1/{never})": math.inf,
        f"mod(floor({never}), 0)": math.nan,
        f"mod(floor({never})-7, -3)": -4,
        f"log({never} + 3, 1)": math.nan,
    }.items():
        assert str(model.check(text).value) in (str(expected), f"{expected}.0"), text
