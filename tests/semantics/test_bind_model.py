from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from semantics.test_evaluate import same
from symcheck.errors import InputError, NameFault, TypeFault
from symcheck.semantics.binding.bind import bind, undefined_constants
from symcheck.semantics.binding.bind_properties import bind_expression
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import ModelType, Name, Type
from symcheck.syntax.parse import parse_expression, parse_model
from symcheck.syntax.traversal import nodes

MODULE = "module m s : [0..2] init 0; [] s=0 -> (s'=1); endmodule\n"


def model(
    text: str, constants: dict[str, Value | str] | None = None, **options: object
) -> BoundModel:
    return bind(parse_model(text), constants, **options)


# ------------------------------------------------------------------------------------------------ constants


@pytest.mark.parametrize(
    ("declared", "given", "real", "exact"),
    [
        ("int", 5, 5, 5),
        ("int", "5", 5, 5),
        ("int", " -5 ", -5, -5),
        ("int", "2*K", 6, 6),
        ("int", "floor(7/2)", 3, 3),
        ("int", np.int64(5), 5, 5),
        ("double", 5, 5.0, Fraction(5)),
        ("double", "1/3", 1 / 3, Fraction(1, 3)),
        ("double", "1/1/3", 1 / 3, Fraction(1, 3)),
        ("double", "0.1", 0.1, Fraction(1, 10)),
        ("double", "-1e-3", -0.001, Fraction(-1, 1000)),
        ("double", 0.1, 0.1, Fraction(1, 10)),
        ("double", Fraction(1, 3), 1 / 3, Fraction(1, 3)),
        ("double", np.float64(0.5), 0.5, Fraction(1, 2)),
        ("double", "1/0", math.inf, math.inf),
        ("double", math.inf, math.inf, math.inf),
        ("bool", True, True, True),
        ("bool", "true", True, True),
        ("bool", "False", False, False),
        ("bool", "K>2", True, True),
    ],
)
def test_given_constants(declared: str, given: Value | str, real: Value, exact: Value) -> None:
    text = f"dtmc const int K = 3; const {declared} c; {MODULE}"
    assert same(model(text, {"c": given}).constants["c"], real)
    assert same(model(text, {"c": given}, exact=True).constants["c"], exact)


@pytest.mark.parametrize(
    ("declared", "given"),
    [("int", 0.5), ("int", "1/2"), ("int", True), ("int", 5.0), ("bool", 1), ("double", "true")],
)
def test_given_constants_of_the_wrong_type(declared: str, given: Value | str) -> None:
    with pytest.raises(TypeFault) as caught:
        model(f"dtmc const {declared} c; {MODULE}", {"c": given})
    assert caught.value.diagnostics[0].code == "constant-type"


def test_constants_in_any_order_and_through_formulas() -> None:
    bound = model(
        f"dtmc const double c = f/b; const int b = 2*a; formula f = a+b; const int a; {MODULE}",
        {"a": 2},
    )
    assert dict(bound.constants) == {"c": 1.5, "b": 4, "a": 2}
    assert list(bound.constants) == ["c", "b", "a"]


def test_a_given_constant_may_repeat_what_the_model_says() -> None:
    text = f"dtmc const int N = 3; const double p = 1/3; {MODULE}"
    assert model(text, {"N": "3", "p": "1/3"}).constants["N"] == 3
    with pytest.raises(NameFault, match="given the value 4, but it is defined as 3"):
        model(text, {"N": 4})


def test_undefined_constants() -> None:
    assert [
        c.name
        for c in undefined_constants(
            parse_model(f"dtmc const int a; const b = 1; const bool c; {MODULE}")
        )
    ] == ["a", "c"]


def test_an_infinite_constant_can_be_used() -> None:
    bound = model(
        'dtmc const double big = 1/0; const double nan = big-big; label "l" = s<big; label "n" = nan=nan;'
        + MODULE
    )
    assert evaluate(bound.labels["l"], {"s": 1}) is True
    assert evaluate(bound.labels["n"], {}) is False


def test_literals_stay_exact() -> None:
    text = f'dtmc const double p = 0.500000000000000000000000000000001; label "l" = p>0.5; label "m" = 1/3=0.333333333333333333; {MODULE}'
    for exact in (False, True):
        bound = model(text, exact=exact)
        assert bound.is_rational is exact
        assert bound.labels == {"l": parse_expression("true"), "m": parse_expression("false")}


@pytest.mark.parametrize("given", ["0.1", "1/10", 0.1])
def test_constants_of_constants_stay_exact(given) -> None:
    text = f'dtmc const double p; const double q = p*3; label "l" = q=0.3; {MODULE}'
    bound = model(text, {"p": given})
    assert bound.labels == {"l": parse_expression("true")}
    assert bound.constants["q"] == pytest.approx(0.3)
    of_property, _ = bind_expression(parse_expression("q=0.3 & p+0.2=0.3"), bound)
    assert of_property == parse_expression("true")


def test_irrational_constants_stay_expressions() -> None:
    text = f'dtmc const double r = pow(2,0.5); label "l" = r*r<1.9999999999999999999; {MODULE}'
    assert evaluate(model(text).labels["l"], {}) is False


# ------------------------------------------------------------------------------------------------ types of models, variables


def test_type_of_model() -> None:
    assert model(MODULE).type is ModelType.MDP
    assert model("ctmc " + MODULE).type is ModelType.CTMC
    assert model("ctmc " + MODULE, model_type=ModelType.DTMC).type is ModelType.DTMC


def test_variables() -> None:
    bound = model(
        """dtmc const int N = 2;
        module m a : [N..2*N]; b : bool; c : int; d : [-1..1] init N-1; e : bool init N>1; endmodule
        global g : [1..1]; module n f : int init -7; endmodule"""
    )
    assert [(v.name, v.type, v.low, v.high, v.initial, v.module) for v in bound.variables] == [
        ("g", Type.INT, 1, 1, 1, None),
        ("a", Type.INT, 2, 4, 2, "m"),
        ("b", Type.BOOL, 0, 1, False, "m"),
        ("c", Type.INT, None, None, 0, "m"),
        ("d", Type.INT, -1, 1, 1, "m"),
        ("e", Type.BOOL, 0, 1, True, "m"),
        ("f", Type.INT, None, None, -7, "n"),
    ]
    assert [m.variables for m in bound.modules] == [(1, 2, 3, 4, 5), (6,)]
    assert bound.index("d") == 4


def test_several_initial_states() -> None:
    bound = model("dtmc module m s : [0..2]; endmodule init s>N endinit const int N = 1;")
    assert bound.initial == parse_expression("s>1")
    assert bound.variables[0].initial is None


# ------------------------------------------------------------------------------------------------ formulas and copies


def test_everything_is_over_variables_and_literals() -> None:
    bound = model(
        """dtmc const int N; const double p = 1/4; formula f = s<N+1; formula g = f & !(s=0);
        module m s : [0..N]; [a] g -> p:(s'=s-1) + 1-p:(s'=min(s+1,N)); endmodule
        label "f" = f; rewards "r" [a] g : N/2; f : s*p; [] true : 1; endrewards""",
        {"N": 3},
    )
    command = bound.modules[0].commands[0]
    assert command.guard == parse_expression("s<4 & !(s=0)")
    assert [u.probability for u in command.updates] == [
        parse_expression("0.25"),
        parse_expression("0.75"),
    ]
    assert [u.assignments for u in command.updates] == [
        ((0, parse_expression("s-1")),),
        ((0, parse_expression("min(s+1,3)")),),
    ]
    assert bound.labels == {"f": parse_expression("s<4")}
    items = bound.rewards[0].items
    assert [(i.on_states, i.action, i.guard, i.value) for i in items] == [
        (False, "a", parse_expression("s<4 & !(s=0)"), parse_expression("1.5")),
        (True, None, parse_expression("s<4"), parse_expression("s*0.25")),
        (False, None, parse_expression("true"), parse_expression("1")),
    ]
    assert bound.actions == ("a",)


def test_an_update_without_probability_has_one() -> None:
    update = model("dtmc " + MODULE).modules[0].commands[0].updates[0]
    assert update.probability == parse_expression("1.0")


def test_formulas_are_expanded_before_renaming() -> None:
    bound = model(
        """mdp formula busy = x>0 & y=0;
        module m x : [0..3]; [go] busy & x<k -> (x'=x+k); endmodule
        module n = m [ x=y, y=x, go=stop, k=l ] endmodule
        module o = n [ y=z, stop=go ] endmodule
        const int k = 1; const int l = 2;"""
    )
    guards = [m.commands[0].guard for m in bound.modules]
    assert guards == [
        parse_expression(t) for t in ("x>0 & y=0 & x<1", "y>0 & x=0 & y<2", "z>0 & x=0 & z<2")
    ]
    assert [m.commands[0].action for m in bound.modules] == ["go", "stop", "go"]
    assert [m.commands[0].updates[0].assignments for m in bound.modules] == [
        ((0, parse_expression("x+1")),),
        ((1, parse_expression("y+2")),),
        ((2, parse_expression("z+2")),),
    ]
    assert [v.module for v in bound.variables] == ["m", "n", "o"]


def test_a_renaming_may_put_one_formula_in_the_place_of_another() -> None:
    bound = model(
        """mdp formula left = y>0; formula right = x>1;
        module m x : [0..3]; [] left -> (x'=0); endmodule
        module n = m [ x=y, left=right ] endmodule"""
    )
    assert [m.commands[0].guard for m in bound.modules] == [
        parse_expression("y>0"),
        parse_expression("x>1"),
    ]


def test_bounds_of_a_copy_use_its_constants() -> None:
    bound = model(
        "mdp const int N = 1; const int M = 5; module m x : [0..N] init N; endmodule module n = m [ x=y, N=M ] endmodule"
    )
    assert [(v.low, v.high, v.initial) for v in bound.variables] == [(0, 1, 1), (0, 5, 5)]


def test_an_unused_formula_needs_no_type() -> None:
    assert model(f"dtmc formula odd = s & 1; {MODULE}").labels == {}


def test_nested_formulas_are_expanded_once() -> None:
    doubling = " ".join(f"formula f{i + 1} = f{i} & f{i};" for i in range(200))
    bound = model(f'dtmc formula f0 = s=0; {doubling} {MODULE} label "l" = f3;')
    assert sum(isinstance(n, Name) for n in nodes(bound.labels["l"])) == 8


def test_long_expressions() -> None:
    parts = " ".join(
        f"formula g{i} = {' | '.join(['g' + str(i - 1)] + ['s=1'] * 1000) if i else 's=0'};"
        for i in range(5)
    )
    bound = model(f'dtmc {parts} {MODULE} label "l" = g4;')
    assert evaluate(bound.labels["l"], {"s": 2}) is False
    assert evaluate(bound.labels["l"], {"s": 0}) is True


def test_all_faults_are_told_at_once() -> None:
    with pytest.raises(InputError) as caught:
        model("dtmc const int N; module m s : [0..2]; [] t=0 -> (s'=0.5); [a] s -> true; endmodule")
    assert not isinstance(caught.value, NameFault | TypeFault)
    assert [d.code for d in caught.value.diagnostics] == [
        "undefined-constant",
        "unknown-name",
        "type",
        "type",
    ]


def test_globals() -> None:
    bound = model(
        "mdp global g : bool; module m s : bool; [] g -> (g'=false)&(s'=g); [a] g -> (s'=true); endmodule"
    )
    assert bound.modules[0].commands[0].updates[0].assignments == (
        (0, parse_expression("false")),
        (1, Name("g")),
    )


def test_labels_use_labels():
    labels = """
    label "low" = s<1 & !"middle";
    label "middle" = "exact" | s=5;
    label "exact" = s=2;
    """
    found = model(MODULE + labels).labels
    assert found["low"] == parse_expression("s<1 & !(s=2 | s=5)")
