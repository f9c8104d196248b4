"""The tables are those of the grammars, and the driver reads as Lark does."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from lark import Lark

from symcheck.errors import Source
from symcheck.syntax import grammars, tables
from symcheck.syntax.generate import generate
from symcheck.syntax.lexer import scan
from symcheck.syntax.parse import parse_model, parse_properties
from symcheck.syntax.tree_builder import Builder, ModelBuilder, PropertiesBuilder
from syntax.samples import MODEL, PROPERTIES


def test_tables_are_current() -> None:
    assert Path(str(tables.__file__)).read_text(encoding="utf-8") == generate(), (
        "run python -m symcheck.syntax.generate"
    )


@pytest.mark.parametrize(
    ("name", "start", "text", "builder", "parse"),
    [
        ("prism", "program", MODEL, ModelBuilder, parse_model),
        ("properties", "properties", PROPERTIES, PropertiesBuilder, parse_properties),
    ],
)
def test_lark_agrees(name: str, start: str, text: str, builder: type[Builder], parse: Any) -> None:
    """Lark's own parser, with our builders at the nodes of its tree."""
    lark = Lark(
        grammars.read(f"{name}.lark"),
        parser="lalr",
        lexer="basic",
        start=start,
        propagate_positions=True,
    )
    tree = lark.parse(text)
    build = builder(Source("", text))

    def value(node: Any) -> Any:
        if not hasattr(node, "data"):
            return None if node is None else str(node)
        parts = [value(child) for child in node.children]
        return getattr(build, str(node.data))(
            parts, getattr(node.meta, "start_pos", 0), getattr(node.meta, "end_pos", 0)
        )

    assert value(tree) == parse(text)


def test_words_are_those_of_lark() -> None:
    for name, text in (("prism", MODEL), ("properties", PROPERTIES)):
        lark = Lark(
            grammars.read(f"{name}.lark"),
            parser="lalr",
            lexer="basic",
            start="program" if name == "prism" else "properties",
        )
        expected = [(t.type, t.start_pos, t.end_pos) for t in lark.lex(text)]
        grammar = grammars.load(name)
        words = scan(text, grammar)
        assert [
            (grammar.terminals[k], a, b)
            for k, a, b in zip(words.kinds, words.starts, words.ends, strict=True)
        ][:-1] == expected


def test_a_run_needs_no_lark() -> None:
    assert "lark" not in vars(import_module("symcheck.syntax.parse"))
