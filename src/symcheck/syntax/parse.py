"""From texts to syntax trees."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from symcheck.errors import Diagnostic, Source, SyntaxFault, UsageError
from symcheck.syntax.ast import Expression
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.diagnostics import diagnose
from symcheck.syntax.grammars import load
from symcheck.syntax.lalr import MAX_NESTING, Parser
from symcheck.syntax.lexer import scan
from symcheck.syntax.tree_builder import Builder, ModelBuilder, PropertiesBuilder

__all__ = [
    "parse_expression",
    "parse_model",
    "parse_model_file",
    "parse_properties",
    "parse_properties_file",
]

_MODEL_PARTS = frozenset({"item", "variable", "command", "reward_item"})
_MODEL_OPENERS = [
    *(
        "CONST",
        "RATE",
        "PROB",
        "FORMULA",
        "GLOBAL",
        "LABEL",
        "MODULE",
        "ENDMODULE",
        "REWARDS",
        "ENDREWARDS",
        "INIT",
        "SYSTEM",
    ),
    *("LSQB", "DTMC", "CTMC", "MDP"),
]
_PROPERTY_PARTS = frozenset({"property"})
_PROPERTY_OPENERS = [
    "CONST",
    "FORMULA",
    "LABEL",
    "P",
    "PMIN",
    "PMAX",
    "RELEASE",
    "RMIN",
    "RMAX",
    "S",
    "FILTER",
    "MULTI",
    "STRING",
]

_EASY_NESTING = 100
_FRAMES_PER_LEVEL = 12


def parse_model(text: str, name: str = "<model>") -> Program:
    """The program that a model text writes. Raises SyntaxFault with a diagnostic for each error found."""
    source = Source(name, text)
    return cast(
        Program,
        _parse("prism", "program", source, ModelBuilder(source), _MODEL_PARTS, _MODEL_OPENERS),
    )


def parse_properties(text: str, name: str = "<properties>") -> PropertiesFile:
    """The properties, constants, labels and formulas of a properties text. Raises SyntaxFault."""
    source = Source(name, text)
    return cast(
        PropertiesFile,
        _parse(
            "properties",
            "properties",
            source,
            PropertiesBuilder(source),
            _PROPERTY_PARTS,
            _PROPERTY_OPENERS,
        ),
    )


def parse_expression(text: str, name: str = "<expression>") -> Expression:
    """A single property or expression over states, such as `P=? [ F x=1 ] + 0.5` or `x>2`. Raises SyntaxFault."""
    source = Source(name, text)
    return cast(
        Expression,
        _parse("properties", "state", source, PropertiesBuilder(source), frozenset(), []),
    )


def parse_model_file(path: str | Path) -> Program:
    """`parse_model` on a file. Raises UsageError if it cannot be read."""
    return parse_model(_read(path), str(path))


def parse_properties_file(path: str | Path) -> PropertiesFile:
    """`parse_properties` on a file. Raises UsageError if it cannot be read."""
    return parse_properties(_read(path), str(path))


def _read(path: str | Path) -> str:
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror or error}") from error
    if b"\0" in data[:1000]:
        raise UsageError(
            f"cannot read {path}: it is no text\n  hint: models of other tools are read with -import…; see symcheck --help"
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _first_of_each_line(found: list[Diagnostic]) -> list[Diagnostic]:
    """One diagnostic a line: what comes after it there mostly follows from it."""
    lines: dict[int, Diagnostic] = {}
    for diagnostic in found:
        lines.setdefault(diagnostic.span.source.position(diagnostic.span.start)[0], diagnostic)
    return list(lines.values())


@contextmanager
def _collector_paused() -> Iterator[None]:
    """No garbage collection meanwhile: nothing here is cyclic, and looking through a growing tree again and again doubles the time."""
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()


def _parse(
    grammar_name: str,
    start: str,
    source: Source,
    build: Builder,
    parts: frozenset[str],
    openers: list[str],
) -> Any:
    grammar = load(grammar_name)
    with _collector_paused():
        words = scan(source.text, grammar)
        parser = Parser(grammar, words, build, parts, frozenset(grammar.kinds[o] for o in openers))
        value = parser.parse(start)
    if parser.faults or build.diagnostics:
        found = [
            diagnose(fault, source, grammar, words) for fault in parser.faults
        ] + build.diagnostics
        raise SyntaxFault(*_first_of_each_line(sorted(found, key=lambda d: d.span.start)))
    if parser.deepest > _EASY_NESTING:
        # Later stages follow expressions by recursion, of which Python allows 1000 calls at first.
        sys.setrecursionlimit(
            max(
                sys.getrecursionlimit(), 1000 + _FRAMES_PER_LEVEL * min(parser.deepest, MAX_NESTING)
            )
        )
    return value
