from __future__ import annotations

import pytest

from symcheck.errors import InputError, NameFault, TypeFault
from symcheck.semantics.expressions.types import type_of
from symcheck.syntax.ast import LabelReference, Type
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.tree_builder import MAX_NESTING

TYPES = {"i": Type.INT, "d": Type.DOUBLE, "b": Type.BOOL}
LABELS = {"l": Type.BOOL, "init": Type.BOOL, "number": Type.DOUBLE}


def label(node: LabelReference) -> Type:
    return LABELS[node.name]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("i+1", "int"),
        ("i+1.0", "double"),
        ("i/1", "double"),
        ("i^2", "int"),
        ("pow(i,2.0)", "double"),
        ("min(i,2,d)", "double"),
        ("max(i)", "int"),
        ("round(d)", "int"),
        ("log(i,2)", "double"),
        ("mod(i,2)", "int"),
        ("b?i:d", "double"),
        ("b?b:i=1", "bool"),
        ("i=d & b!=false", "bool"),
        ("-d", "double"),
        ('"l" & "init"', "bool"),
        ('"number"+1', "double"),
        ("P=? [ F b ]", "double"),
        ("P>0.5 [ b U i=1 ]", "bool"),
        ("1-P=? [ X !b ]", "double"),
        ('R{"x"}=? [ F "l" ]', "double"),
        ("R<5 [ C<=10 ]", "bool"),
        ("S=? [ b ]", "double"),
        ("S>0.5 [ b ]", "bool"),
        ("A [ G b ] & E [ F b ]", "bool"),
        ("filter(count, b)", "int"),
        ("filter(avg, i, b)", "double"),
        ("filter(max, i, b)", "int"),
        ("filter(argmax, i)", "bool"),
        ("filter(state, P=? [ F b ], b)", "double"),
        ("filter(forall, b)", "bool"),
        ("multi(Pmax=? [ F b ], P>=0.5 [ G b ])", "double"),
        ("multi(P>=0.1 [ F b ], P>=0.5 [ G b ])", "bool"),
        ('P=? [ (F b) & (G F !b) => (X "l") ]', "double"),
        ("P=? [ F P>0.5 [ X b ] ]", "double"),
    ],
)
def test_types(text: str, expected: str) -> None:
    assert type_of(parse_expression(text), TYPES, label) is Type(expected)


@pytest.mark.parametrize(
    "text",
    [
        "b+1",
        "!i",
        "-b",
        "b<1",
        "b=1",
        "b?1:b",
        "i?1:2",
        "mod(d,2)",
        "min(b)",
        "P=? [ F i ]",
        "P>b [ F b ]",
        "P=? [ b U d ]",
        "S=? [ i ]",
        "R=? [ I=b ]",
        "R{d}=? [ C ]",
        "filter(forall, i)",
        "filter(sum, b)",
        "filter(max, i, i)",
        "multi(Pmax=? [ F i ])",
        "P=? [ F<=b b ]",
    ],
)
def test_faults(text: str) -> None:
    with pytest.raises(TypeFault) as caught:
        type_of(parse_expression(text), TYPES, label)
    assert len(caught.value.diagnostics) == 1


def test_all_faults_are_told_in_order() -> None:
    with pytest.raises(InputError) as caught:
        type_of(parse_expression("(b+1>0) & (x=1) & !i"), TYPES)
    assert [d.code for d in caught.value.diagnostics] == ["type", "unknown-name", "type"]


def test_names_must_be_known_and_labels_allowed() -> None:
    with pytest.raises(NameFault, match="unknown name j"):
        type_of(parse_expression("j+1"), TYPES)
    with pytest.raises(TypeFault, match="a label cannot be used here"):
        type_of(parse_expression('"l"'), TYPES)


def test_deep_expressions() -> None:
    assert type_of(parse_expression(" | ".join(["b"] * 1900)), TYPES) is Type.BOOL
    assert (
        type_of(parse_expression("b?1:" * (MAX_NESTING - 100) + "2"), TYPES) is Type.INT
    )  # less deep on Python 3.12
