"""From texts to syntax trees."""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from lark import UnexpectedInput

from symcheck.errors import NO_SPAN, Diagnostic, Source, SyntaxFault, UsageError
from symcheck.syntax.ast import Expression
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.grammars import load, load_interactive

__all__ = [
    "parse_expression",
    "parse_model",
    "parse_model_file",
    "parse_properties",
    "parse_properties_file",
]

_EASY_NESTING = 100
_FRAMES_PER_LEVEL = 12
_ONE_AT_A_TIME = threading.Lock()


def parse_model(text: str, name: str = "<model>") -> Program:
    """The program that a model text writes. Raises SyntaxFault with a diagnostic for each error found."""
    return cast(Program, _parse("prism", "program", Source(name, text)))


def parse_properties(text: str, name: str = "<properties>") -> PropertiesFile:
    """The properties, constants, labels and formulas of a properties text. Raises SyntaxFault."""
    return cast(PropertiesFile, _parse("properties", "properties", Source(name, text)))


def parse_expression(text: str, name: str = "<expression>") -> Expression:
    """A single property or expression over states, such as `P=? [ F x=1 ] + 0.5` or `x>2`. Raises SyntaxFault."""
    return cast(Expression, _parse("properties", "state", Source(name, text)))


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
            f"cannot read {path}: not a UTF-8 text file"
            "\n  hint: -import… reads models of other tools; see symcheck --help"
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


def _parse(name: str, start: str, source: Source) -> Any:
    language = load(name)
    builder = language.builder
    found: list[Diagnostic] = []
    with _ONE_AT_A_TIME, _collector_paused():
        builder.begin(source)
        try:
            value = language.parser.parse(source.text, start=start)
            if start == "state":
                builder.measure(value)
            found += builder.diagnostics.values()
        except UnexpectedInput:
            found += _faults(name, start, source)
        deepest = builder.deepest
        builder.begin(NO_SPAN.source)
    if found:
        raise SyntaxFault(*_first_of_each_line(sorted(found, key=lambda d: d.span.start)))
    if deepest > _EASY_NESTING:
        # Later stages follow expressions by recursion, of which Python allows 1000 calls at first.
        needed = 1000 + _FRAMES_PER_LEVEL * deepest
        sys.setrecursionlimit(max(sys.getrecursionlimit(), needed))
    return value


def _faults(name: str, start: str, source: Source) -> list[Diagnostic]:
    """The diagnostics of a text that does not follow the grammar."""
    from symcheck.syntax.diagnostics import diagnose
    from symcheck.syntax.recovery import find_faults

    language = load_interactive(name)
    language.builder.begin(source)
    found = [
        diagnose(fault, source, language) for fault in find_faults(language, start, source.text)
    ]
    return [*found, *language.builder.diagnostics.values()]
