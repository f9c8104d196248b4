"""Parses models, properties and expressions.

The parser reads the text and calls a builder, which makes the tree. A text is read once, whether it
has faults or not.
"""

from __future__ import annotations

import gc
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from symcheck.errors import NO_SPAN, Diagnostic, Source, SyntaxFault, UsageError
from symcheck.syntax.ast import Expression, Name
from symcheck.syntax.declarations import Program, PropertiesFile, Property
from symcheck.syntax.grammars import Language, load
from symcheck.syntax.operators import CTL_HINTS
from symcheck.syntax.recovery import Fault, read_text
from symcheck.whole_file import read_whole, uncompressed_name

if TYPE_CHECKING:
    from symcheck.syntax.jani.read import JaniFile

__all__ = [
    "is_jani",
    "parse_expression",
    "parse_jani_file",
    "parse_model",
    "parse_model_file",
    "parse_properties",
    "parse_properties_file",
    "text_of_file",
]

_EXPLICIT_FILES = (".all", ".tra", ".sta", ".lab", ".srew", ".trew", ".umb", ".drn")
"""Extensions of files that are no text of a model."""

_EASY_NESTING = 100
"""Later stages follow expressions up to this depth within Python's default limit of recursion."""

_FRAMES_PER_LEVEL = 12
"""The most calls that a later stage makes for one level of an expression."""

_ONE_AT_A_TIME = threading.Lock()
"""Held while a builder serves a text."""


def parse_model(text: str, name: str = "<model>") -> Program:
    """Parse a model in the PRISM language.

    Args:
        text: The whole model.
        name: What diagnostics call the text, such as its file name.

    Returns:
        The syntax tree. Every node has the span of the text that it stands for.

    Raises:
        SyntaxFault: The text does not follow the grammar; it has a diagnostic for each fault.

    Examples:
        >>> parse_model("dtmc module m x : [0..1]; [] x=0 -> (x'=1); endmodule").type
        <ModelType.DTMC: 'dtmc'>
    """
    return cast(Program, _parse("prism", "program", Source(name, text)))


def parse_properties(text: str, name: str = "<properties>", *, shown: str = "") -> PropertiesFile:
    """Parse a properties text: properties, and the constants, labels and formulas among them.

    Args:
        text: The whole text. Semicolons between the properties are optional.
        name: What diagnostics call the text, such as its file name.
        shown: The text of the same length that diagnostics quote, if it is another one.

    Returns:
        The syntax tree, with the comments above each property.

    Raises:
        SyntaxFault: The text does not follow the grammar; it has a diagnostic for each fault.

    Examples:
        >>> len(parse_properties('P=? [ F x=1 ]; "goal": x>2').properties)
        2
    """
    file = cast(PropertiesFile, _parse("properties", "properties", Source(name, text, shown)))
    for one, following in pairwise(file.properties):
        _check_operator(one, following, text)
    return file


def _check_operator(one: Property, following: Property, text: str) -> None:
    """Refuse `AG d=0`, which would be a property AG and another one, d=0."""
    named = one.formula
    hints = {**CTL_HINTS, "if": "a choice is written condition ? value : other value"}
    if not isinstance(named, Name) or named.name not in hints:
        return
    between = text[named.span.end : following.span.start]
    if not between.strip(" \t"):
        message = f"'{named.name}' is not an operator of properties"
        raise SyntaxFault(Diagnostic(message, named.span, "syntax", hints[named.name]))


def parse_expression(text: str, name: str = "<expression>") -> Expression:
    """Parse a single property or expression over states, such as `P=? [ F x=1 ] + 0.5` or `x>2`.

    Args:
        text: The expression, without a semicolon.
        name: What diagnostics call the text.

    Returns:
        The syntax tree.

    Raises:
        SyntaxFault: The text does not follow the grammar. There is one diagnostic, because an
            expression has no parts at which reading could go on.

    Examples:
        >>> parse_expression("x > 2").operator
        '>'
    """
    return cast(Expression, _parse("properties", "state", Source(name, text)))


def parse_model_file(path: str | Path) -> Program:
    """Parse a model file as `parse_model` does, or a file in the JANI format (.jani).

    Raises:
        SyntaxFault: the text is faulty.
        UnsupportedError: a JANI model is of a kind that is not supported.
        UsageError: the file is unreadable.
    """
    if uncompressed_name(path)[0].endswith(_EXPLICIT_FILES):
        hint = "-importmodel reads such files, in Python symcheck.load_explicit"
        raise UsageError(f"{path} lists states or transitions", hint=hint)
    if is_jani(path):
        return parse_jani_file(path).program
    return parse_model(text_of_file(path), str(path))


def parse_properties_file(path: str | Path) -> PropertiesFile:
    """Parse a properties file as `parse_properties` does, or the properties of a JANI file (.jani).

    Raises:
        SyntaxFault: the text is faulty.
        UnsupportedError: a property or the model of a JANI file is not supported.
        UsageError: the file is unreadable.
    """
    if is_jani(path):
        parsed = parse_jani_file(path)
        for fault in parsed.faults.values():
            raise fault
        return parsed.properties
    return parse_properties(text_of_file(path), str(path))


def is_jani(path: str | Path) -> bool:
    """Whether the name of a file is that of a model in the JANI format."""
    return uncompressed_name(path)[0].endswith(".jani")


def parse_jani_file(path: str | Path) -> JaniFile:
    """Parse a file in the JANI format: a model and its properties.

    Raises:
        SyntaxFault: the text is faulty.
        UnsupportedError: the model is of a kind that is not supported.
        UsageError: the file is unreadable.
    """
    from symcheck.syntax.jani.read import read_jani

    return read_jani(text_of_file(path), str(path))


def text_of_file(path: str | Path) -> str:
    """The text of a file. Raises UsageError if it is unreadable, or no text."""
    data = read_whole(path)
    if b"\0" in data[:1000]:
        hint = "-import… reads models of other tools; see symcheck --help"
        raise UsageError(f"cannot read {path}: not a UTF-8 text file", hint=hint)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _first_of_each_line(diagnostics: list[Diagnostic]) -> list[Diagnostic]:
    """The first diagnostic of each line, because further ones mostly follow from it."""
    lines: dict[int, Diagnostic] = {}
    for diagnostic in diagnostics:
        lines.setdefault(diagnostic.span.source.position(diagnostic.span.start)[0], diagnostic)
    return list(lines.values())


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Pause the garbage collector, which would visit the growing tree again and again.

    Parsing takes half the time, and nothing is lost, because trees have no cycles.
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()


def _parse(name: str, start: str, source: Source) -> Any:
    """The value of the start symbol of a grammar."""
    with _ONE_AT_A_TIME, _collector_paused():
        language, value, faults = _read_text(name, start, source)
        builder = language.builder
        if start == "state" and not faults:
            builder.measure(value)
        result = _diagnostics(faults, source, language)
        deepest = builder.deepest
        builder.begin(NO_SPAN.source)
    if result:
        raise SyntaxFault(*_first_of_each_line(sorted(result, key=lambda d: d.span.start)))
    if deepest > _EASY_NESTING:
        # Later stages follow expressions by recursion, of which Python allows 1000 calls at first.
        needed = 1000 + _FRAMES_PER_LEVEL * deepest
        sys.setrecursionlimit(max(sys.getrecursionlimit(), needed))
    return value


def _read_text(name: str, start: str, source: Source) -> tuple[Language, Any, list[Fault]]:
    """The language that has read a text, the value of its start symbol, and the faults."""
    language = load(name)
    language.builder.begin(source)
    return language, *read_text(language, start, source.text)


def _diagnostics(faults: list[Fault], source: Source, language: Language) -> list[Diagnostic]:
    """What is wrong with a text: its faults, and what the builder has noted."""
    noted = list(language.builder.diagnostics.values())
    if not faults:
        return noted
    from symcheck.syntax.diagnostics import diagnose

    result = [diagnose(fault, source, language) for fault in faults]
    return result[:1] if result[0].code == "model" else [*result, *noted]  # of another kind
