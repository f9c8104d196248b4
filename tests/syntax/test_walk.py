"""Walks reach every kind of node, keep what they do not touch, and need no stack."""

from __future__ import annotations

import typing

import pytest

from checking import RESULTS
from symcheck.syntax import ast
from symcheck.syntax.ast import Binary, Literal, Name, Type
from symcheck.syntax.declarations import Composition
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.parse import parse_expression, parse_model, parse_properties_file
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import (
    Tree,
    children,
    names,
    nodes,
    substitute,
    transform,
    with_children,
)

EVERYTHING = [
    *(
        "1 + x",
        "!true",
        "-y",
        'x ? "a" : z',
        "min(x, y, 2)",
        "<<one:two>>{corr,fair} max>=1.5 (P [ F x ] + R{i} [ C<=2 ])",
        "multi(P>0 [ F x ], R{i}<=2 [ C ])",
        "S>p [ x ]",
        "T<=p [ F x ]",
        "A [ G x ]",
        "E [ F x ]",
    ),
    *(
        "filter(max, x, y)",
        "filter(min, x)",
        "P=? [ a U<=k b {c}{min} ]",
        "P<q [ X[1,m] a ]",
        "P=? [ a W=j (b R>k c) ]",
    ),
    "Pmax=? [ F<n a ]",
    *(
        'R{"a"}=? [ C<=t ]',
        "R=? [ I=t ]",
        "R=? [ S ]",
        'R=? [ C{"a"}<=t ]',
        "R=? [ C<=t discount=q ]",
        "P=? [ F a || F b ]",
        "quantile(min k, P>q [ F<=k a ])",
        "R{i+1}=? [ G a ]",
        'P=? [ F^{rew{"a"}<=t} b ]',
        "P=? [ F^{rew{s}<=t} b ]",
    ),
    'P=? [ F^{rew{"a"}[m,n], steps<=k} b ]',
]


FORMULAS = [
    *map(parse_expression, EVERYTHING),
    *(
        p.formula
        for path in sorted(RESULTS.iterdir())
        if path.suffix in (".pctl", ".csl")
        for p in parse_properties_file(path).properties
    ),
]
"""These, and the properties with known results: every measure has one."""


@pytest.mark.parametrize("formula", FORMULAS, ids=pretty)
def test_children_and_back(formula: ast.Expression) -> None:
    for node in nodes(formula):
        parts = children(node)
        assert with_children(node, parts) == node
        changed = tuple(
            transform(p, lambda n: Name(n.name + "_") if isinstance(n, Name) else n) for p in parts
        )
        assert children(with_children(node, changed)) == changed
        assert with_children(node, changed).span == node.span


def test_every_kind_of_node_occurs_above() -> None:
    found = {type(node) for formula in FORMULAS for node in nodes(formula)}
    assert found == set(typing.get_args(Tree)) - set(typing.get_args(Composition))


def test_children_of_compositions() -> None:
    text = "system (a || b) |[x, y]| (c / {x}) ||| d {x <- y} endsystem"
    system = parse_model(text).system
    assert system is not None
    kinds = {type(node) for node in nodes(system)}
    assert kinds == set(typing.get_args(Composition))
    assert all(with_children(node, children(node)) == node for node in nodes(system))


def test_names() -> None:
    assert names(parse_expression('P=? [ F<=T x=1 & "l" ] + R{"r"}=? [ I=k ] * min(a, b)')) == {
        "T",
        "x",
        "k",
        "a",
        "b",
    }


def test_transform_sees_replaced_children() -> None:
    def fold(node: Tree) -> Tree:
        match node:
            case Binary(Operator.PLUS, Literal(int(a), Type.INT), Literal(int(b), Type.INT)):
                return Literal(a + b, Type.INT)
            case _:
                return node

    assert transform(parse_expression("1 + 2 + (3 + 4) + x"), fold) == parse_expression("10 + x")


def test_untouched_parts_are_shared() -> None:
    tree = parse_expression("(a & b) | c")
    assert isinstance(tree, Binary)
    new = substitute(tree, {"c": Name("d")})
    assert new.left is tree.left
    assert transform(tree, lambda node: node) is tree


def test_substitute_at_once() -> None:
    tree = parse_expression("P=? [ F<=x y ]")
    assert substitute(tree, {"x": Name("y"), "y": parse_expression("x+1")}) == parse_expression(
        "P=? [ F<=y x+1 ]".replace("x+1", "(x+1)")
    )


def test_any_depth() -> None:
    tree: ast.Expression = Name("x")
    for _ in range(50_000):
        tree = ast.Unary(UnaryOperator.MINUS, tree)
    assert names(substitute(tree, {"x": Name("y")})) == {"y"}
    while isinstance(tree, ast.Unary):
        tree = tree.operand
