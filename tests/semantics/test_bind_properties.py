from __future__ import annotations

from fractions import Fraction

import pytest

from semantics.cases import raise_faults
from symcheck.errors import InputError, NameFault, TypeFault
from symcheck.semantics.binding import bind_properties as bind_properties_module
from symcheck.semantics.binding.bind import (
    BoundProperties,
    bind,
    bind_expression,
    bind_properties,
    bind_property,
    needed_constants,
    split_constants,
    without_unused_faults,
)
from symcheck.semantics.rewards import Structure, operator_reward
from symcheck.syntax.ast import Expression, RewardOperator, Type
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties

MODEL = """const int N; const double p = 1/2; formula late = s>N;
module m s : [0..4]; [] s<4 -> p:(s'=s+1) + 1-p:true; endmodule
label "late" = late;
rewards true : 1; endrewards
rewards "steps" true : 2; endrewards"""


def bound(
    text: str, *, kind: str = "dtmc", exact: bool = False, **constants: object
) -> BoundProperties:
    return bind_properties(
        parse_properties(text),
        bind(parse_model(f"{kind} {MODEL}"), {"N": 2}, exact=exact),
        constants,
    )


def test_names_are_resolved() -> None:
    text = """const int k = N+1; formula early = !late; label "early" = early;
    P=? [ F<=k*2 early & s=k ];
    P>=p [ "early" U "late" ];
    R{"steps"}=? [ I=N ] + p;"""
    properties = bound(text)
    expected = [
        "P=? [ F<=6 !(s>2) & s=3 ]",
        'P>=0.5 [ "early" U "late" ]',
        'R{"steps"}=? [ I=2 ] + 0.5',
    ]
    assert [p.formula for p in properties.properties] == [parse_expression(t) for t in expected]
    assert [p.type for p in properties.properties] == [Type.DOUBLE, Type.BOOL, Type.DOUBLE]
    assert properties.labels == {
        "late": parse_expression("s>2"),
        "early": parse_expression("!(s>2)"),
    }
    assert properties.constants == {"N": 2, "p": 0.5, "k": 3}


def test_one_property_is_bound_as_among_all(monkeypatch: pytest.MonkeyPatch) -> None:
    text = """label "early" = s<k; const int k;
    "a": P=? [ F "late" & s=missing ];
    "b": P=? [ "early" U "c" ];
    "c": P>=p [ F "late" ];"""
    file, model = parse_properties(text), bind(parse_model(f"dtmc {MODEL}"), {"N": 2})
    together = bind_properties(file, model, {"k": 3})
    typed = []
    typed_formula = bind_properties_module._Properties._typed

    def count(self: bind_properties_module._Properties, x: Expression) -> tuple[Expression, Type]:
        typed.append(x)
        return typed_formula(self, x)

    monkeypatch.setattr(bind_properties_module._Properties, "_typed", count)
    alone, labels = bind_property(file, 1, model, {"k": 3})
    assert (alone, labels) == (together.properties[1], together.labels)
    assert len(typed) == 1
    faulty, _ = bind_property(file, 0, model, {"k": 3})
    assert faulty.fault is not None


def test_exact() -> None:
    (p,) = bound("const double q = 1/3; P>=q [ F late ];", exact=True).properties
    assert p.formula.bound.threshold.value == Fraction(1, 3)


def test_properties_refer_to_each_other() -> None:
    text = '"six": P=? [ F s=4 ] + "x"; const int x = 3; "x": P=? [ F s=x ] + "y"; "y": 1.0; "late": 2.0; "z": "late" & "y">0;'
    properties = bound(text)
    assert properties.find("six").formula == parse_expression(
        "P=? [ F s=4 ] + (P=? [ F s=3 ] + 1.0)"
    )
    # A label comes before a property.
    assert properties.find("z").formula == parse_expression('"late"')


def test_labels_refer_to_labels() -> None:
    properties = bound('label "a" = "late" | "b"; label "b" = s=0; P=? [ F "a" ];')
    assert properties.labels["a"] == parse_expression("s>2 | s=0")


def test_find() -> None:
    properties = bound('"one": true; "two": false; s=0;')
    assert properties.find("one") is properties.find(1) is properties.find("1")
    assert properties.find("two") is properties.find("2") is properties.properties[1]
    assert properties.find("3") is properties.properties[2]
    for unknown in ("on", "4", 0):
        with pytest.raises(NameFault, match="there is no property"):
            properties.find(unknown)
    with pytest.raises(NameFault, match="did you mean one"):
        properties.find("onee")


def test_a_missing_constant_stops_only_those_that_need_it() -> None:
    text = """const int k; const int l = k; const double t; label "k" = s=l; formula f = s=k;
    P=? [ F late ]; P=? [ F "k" ]; P=? [ F f ]; "t": P<t [ F late ]; "t" | late; P=? [ F<=N late ];"""
    properties = bound(text)
    assert [p.missing for p in properties.properties] == [(), ("k",), ("k",), ("t",), ("t",), ()]
    assert [p.undefined for p in properties.properties] == [
        ("N",),
        ("N", "k"),
        ("N", "k"),
        ("N", "t"),
        ("N", "t"),
        ("N",),
    ]
    assert properties.properties[0].formula is not None
    assert properties.constants == {"N": 2, "p": 0.5}
    with pytest.raises(NameFault, match="give it with -const k=VALUE"):
        assert properties.properties[1].formula
    raise_faults(properties)
    known = bound(text, k="2", t=0.25)
    assert [p.missing for p in known.properties] == [()] * 6
    assert known.properties[1].constants == {"N": 2, "p": 0.5, "k": 2, "l": 2, "t": 0.25}
    assert known.labels["k"] == parse_expression("s=2")


def test_needed_constants_without_values() -> None:
    program = parse_model(f"dtmc const bool unused; {MODEL}")
    file = parse_properties(
        'const int k; const int l = k+N; "a": s=l; s=0; "a" & late; label "l" = s=l; P=? [ F "l" ];'
    )
    model = ("unused", "N")
    assert needed_constants(program, file) == ((*model, "k"), model, (*model, "k"), (*model, "k"))


def test_split_constants() -> None:
    program, file = parse_model(f"dtmc {MODEL}"), parse_properties("const int k; s=k;")
    split = split_constants(program, file, {"N": 1, "k": 2, "kk": 3})
    assert (split.of_model, split.of_properties) == ({"N": 1}, {"k": 2})
    assert [(d.severity, d.code, d.hint) for d in split.warnings] == [
        ("warning", "unknown-constant", "did you mean k?")
    ]
    assert split_constants(program, None, {"N": 1}).warnings == ()


def test_faults_stay_with_their_property() -> None:
    properties = bound(
        "P=? [ F sx=0 ]; s=0; P=? [ F s ]; const double c = 2^-1; P>c [ F late ]; P=? [ F<=-1 late ];"
    )
    kinds = [None if p.fault is None else type(p.fault) for p in properties.properties]
    assert kinds[:3] == [NameFault, None, TypeFault]
    assert [p.fault.diagnostics[0].code for p in properties.properties[3:]] == [
        "pow-negative",
        "bound-negative",
    ]
    with pytest.raises(InputError) as caught:
        raise_faults(properties)
    assert len(caught.value.diagnostics) == 4


def test_a_formula_with_a_fault_is_told_by_all_that_use_it() -> None:
    properties = bound("formula f = s & true; P=? [ F f ]; P=? [ G f ];")
    assert [type(p.fault) for p in properties.properties] == [TypeFault, TypeFault]


def test_a_faulty_definition_is_told_by_all_that_use_it() -> None:
    properties = bound(
        """const int k = 2.5; const int l = k; label "l" = s=l; label "f" = l; "sound": s=0;
        P=? [ F "l" ]; P=? [ F<=k late ]; "n": P=? [ F "f" ]; "n">0;"""
    )
    kinds = [type(p.fault) for p in properties.properties]
    assert kinds == [type(None), *[TypeFault] * 4]
    assert "k" not in properties.constants
    assert "l" not in properties.labels
    faults = [f.diagnostics for f in (p.fault for p in properties.properties) if f]
    assert faults[0] == faults[1]
    assert faults[2] == faults[3]
    assert "k is of type int" in faults[0][0].message


def test_a_faulty_definition_that_nobody_uses_is_no_property_s_fault() -> None:
    text = 'const int k = 2.5; const int l = k; label "init" = s=0; label "a" = s=1; P=? [ F "a" ];'
    with pytest.raises(InputError) as caught:
        bound(text)
    assert len(caught.value.diagnostics) == 2
    model = bind(parse_model(f"dtmc {MODEL}"), {"N": 2})
    sound, fault = without_unused_faults(parse_properties(text), model)
    assert fault.diagnostics == caught.value.diagnostics
    assert (sound.constants, [x.name for x in sound.labels]) == ((), ["a"])
    assert bind_properties(sound, model).properties[0].fault is None
    assert without_unused_faults(sound, model) == (sound, None)


@pytest.mark.parametrize(
    ("kind", "text", "code"),
    [
        ("dtmc", "P=? [ F<=1.0 late ];", "type"),
        ("mdp", "Pmax=? [ F<=1.0 late ];", "type"),
        ("ctmc", "P=? [ F<=1.5 late ];", None),
        ("ctmc", "P=? [ F[0.5,0.5] late ];", None),
        ("ctmc", "P=? [ F[0.6,0.5] late ];", "bound-empty"),
        ("ctmc", "R=? [ C<=1/0 ];", "bound-negative"),
        ("dtmc", "P=? [ F>=3 late ];", None),
        ("dtmc", "P=? [ F<0 late ];", "bound-empty"),
        ("dtmc", "P=? [ F<1 late ];", None),
        ("dtmc", "P>=1 [ F late ];", None),
        ("dtmc", "P>=1.01 [ F late ];", "threshold"),
        ("dtmc", "P>=s [ F late ];", "not-constant"),
        ("dtmc", 'P>="late" [ F late ];', "type"),
        ("dtmc", "R>=-1 [ F late ];", None),
        ("mdp", "P=? [ F late ];", "direction"),
        ("mdp", "P>0.5 [ F late ];", None),
        ("mdp", "Pmin=? [ F late ];", None),
        ("dtmc", "Pmax=? [ F late ];", None),
        ("mdp", "R=? [ F late ];", "direction"),
        ("dtmc", "R{1+1}=? [ C<=3 ];", None),
        ("dtmc", "R{0}=? [ C<=3 ];", "unknown-rewards"),
        ("dtmc", 'R{"step"}=? [ C<=3 ];', "unknown-rewards"),
        ("dtmc", "R{s}=? [ C<=3 ];", "not-constant"),
    ],
)
def test_conditions(kind: str, text: str, code: str | None) -> None:
    (p,) = bound(text, kind=kind).properties
    assert (None if p.fault is None else p.fault.diagnostics[0].code) == code
    assert (p.bound is None) == (code is not None)


def test_the_reward_of_an_operator() -> None:
    model = bind(parse_model(f"dtmc {MODEL}"), {"N": 2})
    for text, index in (
        ("R=? [ C ]", 0),
        ('R{"steps"}=? [ C ]', 1),
        ("R{2}=? [ C ]", 1),
        ("R{N-1}=? [ C ]", 0),
    ):
        (p,) = bind_properties(parse_properties(text), model).properties
        assert isinstance(p.formula, RewardOperator)
        assert operator_reward(p.formula, model) == Structure(index)


def test_bind_expression() -> None:
    model = bind(parse_model(f"dtmc {MODEL}"), {"N": 2})
    text = parse_expression('late & "late" & "own" & s<c & f')
    labels, formulas = {"own": parse_expression("s=N")}, {"f": parse_expression("s>c")}
    expression, kind = bind_expression(
        text, model, labels=labels, constants={"c": 3}, formulas=formulas
    )
    assert (expression, kind) == (parse_expression("s>2 & s>2 & s=2 & s<3 & s>3"), Type.BOOL)
    assert bind_expression(parse_expression("N/2+s"), model)[1] is Type.DOUBLE
    with pytest.raises(InputError, match="properties only"):
        bind_expression(parse_expression("P>0.5 [ F late ]"), model)
    with pytest.raises(NameFault, match="unknown name"):
        bind_expression(parse_expression("t=0"), model)


def test_comments_stay() -> None:
    properties = bound('// RESULT: 1\nP=? [ F late ];\n// RESULT (N=2): true\n"n": true;')
    assert [p.comments for p in properties.properties] == [
        p.comments
        for p in parse_properties(
            '// RESULT: 1\nP=? [ F late ];\n// RESULT (N=2): true\n"n": true;'
        ).properties
    ]
    assert properties.properties[0].comments
