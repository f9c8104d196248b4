"""Diagrams of expressions agree with the scalar evaluator, whichever way they are translated."""

from __future__ import annotations

import math
from itertools import product

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from symbolic.oracle import at, bound
from symcheck.errors import InputError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.symbolic.build import build
from symcheck.symbolic.encoding.translate import TooLarge, Translator
from symcheck.symbolic.model import StateSpace
from symcheck.symbolic.tuning import EncodingLimits
from symcheck.syntax.parse import parse_model

HEADER = "dtmc module m x : [-1..4]; y : [0..2]; b : bool; [] true -> true; endmodule"
WAYS = {
    "tabulated": EncodingLimits(),
    "composed": EncodingLimits(table_bits=0),
    "on the fly": EncodingLimits(table_bits=0, wide_table_bits=0, max_nodes=0, max_leaves=0),
}

_number = st.deferred(
    lambda: st.one_of(
        st.sampled_from(["x", "y", "1", "2", "-3", "0.5", "(b?1:2)"]),
        st.builds("({} {} {})".format, _number, st.sampled_from("+-*/"), _number),
        st.builds("{}({},{})".format, st.sampled_from(["min", "max", "pow"]), _number, _number),
        st.builds("mod({},3)".format, st.sampled_from(["x", "y", "x+y", "x*y"])),
        st.builds("({}?{}:{})".format, _boolean, _number, _number),
        st.builds("{}({})".format, st.sampled_from(["floor", "ceil", "round", "-"]), _number),
    )
)
_boolean = st.deferred(
    lambda: st.one_of(
        st.sampled_from(["b", "true", "x=y", "(x>y)"]),
        st.builds(
            "({} {} {})".format,
            _number,
            st.sampled_from(["=", "!=", "<", "<=", ">", ">="]),
            _number,
        ),
        st.builds(
            "({} {} {})".format, _boolean, st.sampled_from(["&", "|", "=>", "<=>"]), _boolean
        ),
        st.builds("!{}".format, _boolean),
    )
)


def bind_one(text: str, kind: str):
    """A bound expression over the variables: a guard, or a reward."""
    if kind == "bool":
        return bind(parse_model(HEADER + f' label "l" = {text};'), {}).labels["l"]
    return (
        bind(parse_model(HEADER + f" rewards true : {text}; endrewards"), {})
        .rewards[0]
        .items[0]
        .value
    )


def all_states():
    return product(range(-1, 5), range(3), (False, True))


def space_with(limits: EncodingLimits) -> StateSpace:
    model = build(bound(HEADER), Options(), limits=limits)
    translator = model.translator
    everything = model.manager.conjunction([translator.valid(v) for v in model.encoding.variables])
    return StateSpace(model, everything, model.manager.false, 36, "none", 0.0, ())


def value_at(expression, state):
    try:
        value = evaluate(expression, dict(zip("xyb", state, strict=True)))
    except InputError:
        return None
    return None if isinstance(value, float) and math.isnan(value) else value


def has_fault(expression, state):
    try:
        evaluate(expression, dict(zip("xyb", state, strict=True)))
    except InputError:
        return True
    return False


@pytest.mark.parametrize("way", WAYS)
@settings(max_examples=40, deadline=None)
@given(text=_boolean)
def test_booleans(way, text):
    expression = bind_one(text, "bool")
    space = space_with(WAYS[way])
    translator = space.symbolic.translator
    found = translator.boolean_on(expression, space.states)
    faults = translator.faults(expression)
    for state in all_states():
        expected = value_at(expression, state)
        assert at(space, faults, state) == (expected is None)
        if expected is not None:
            assert at(space, found, state) == expected


@pytest.mark.parametrize("way", WAYS)
@settings(max_examples=40, deadline=None)
@given(text=_number)
@example(text="((x = (x / x))?x:y)")
@example(text="((x != (x / x))?x:y)")
def test_numbers(way, text):
    expression = bind_one(text, "number")
    space = space_with(WAYS[way])
    translator = space.symbolic.translator
    found = translator.number_on(expression, space.states)
    undefined, faults = translator.undefined(expression), translator.faults(expression)
    for state in all_states():
        expected = value_at(expression, state)
        assert at(space, faults, state) == has_fault(expression, state)
        if at(space, faults, state):
            continue
        assert at(space, undefined, state) == (expected is None)
        if expected is not None:
            assert at(space, found, state) == pytest.approx(float(expected), rel=1e-13, abs=1e-300)


def test_undefined_values_are_known():
    space = space_with(EncodingLimits())
    expression = bind_one("y/(y*y)", "number")
    undefined = space.symbolic.translator.undefined(expression)
    assert {s[1] for s in space.valuations(undefined)} == {0}


def test_a_wide_sum_is_composed():
    names = [f"x{i}" for i in range(20)]
    declared = " ".join(f"{n} : [0..5];" for n in names)
    model = bound(f"dtmc module m {declared} [] {'+'.join(names)} < 3 -> true; endmodule")
    made = build(model, Options())
    guard = made.events[0].guard
    assert guard.node_count < 400
    valid = made.manager.conjunction([made.translator.valid(v) for v in made.encoding.variables])
    assert made.manager.count(guard & valid, made.encoding.rows) == 1 + 20 + 210  # sums 0, 1 and 2


def test_what_is_too_large_is_known_before_it_is_tried():
    names = [f"x{i}" for i in range(6)]
    declared = " ".join(f"{n} : [0..200];" for n in names)
    terms = "+".join(f"{1 + i / 7}*{n}" for i, n in enumerate(names))
    model = bound(
        f"dtmc module m {declared} [] true -> true; endmodule rewards true : {terms}; endrewards"
    )
    made = build(model, Options())
    translator = Translator(made.manager, made.encoding)
    with pytest.raises(TooLarge, match="different values"):
        translator.number(model.rewards[0].items[0].value)
