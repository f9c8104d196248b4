"""The properties of a run, from a file and from -pf: what does not follow the grammar is left out, and reported in its place."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from symcheck.errors import SyntaxFault
from symcheck.syntax.ast import PropertiesFile
from symcheck.syntax.parse import parse_properties, parse_properties_file

__all__ = ["Broken", "Texts", "read_texts"]

_WORDS = re.compile(r'//[^\n]*|"[^"\n]*"?|;')
_DECLARATION = re.compile(r"\s*(?:const|label|formula)\b")
_COMMENT = re.compile(r"//[^\n]*")


@dataclass(frozen=True)
class Broken:
    """A property that does not follow the grammar: its text on one line, and what is wrong."""

    text: str
    fault: SyntaxFault


@dataclass(frozen=True)
class Texts:
    """All properties, in order. broken: those that do not follow the grammar, by their place; in `file` they are the number 0.

    declarations: what is wrong with constants, labels and formulas; `file` is without them.
    """

    file: PropertiesFile
    broken: Mapping[int, Broken] = field(default_factory=dict)
    declarations: Sequence[SyntaxFault] = ()


def read_texts(path: str | None, texts: Sequence[str]) -> Texts:
    """The properties of a file and of -pf. Raises UsageError, and SyntaxFault where nothing can be told apart."""
    parts = [*([_read(path)] if path else []), *(_parsed(text) for text in texts)]
    broken: dict[int, Broken] = {}
    count = 0
    for part in parts:
        broken |= {count + i: fault for i, fault in part.broken.items()}
        count += len(part.file.properties)
    return Texts(_joined([p.file for p in parts]), broken, [f for p in parts for f in p.declarations])


def _joined(files: Sequence[PropertiesFile]) -> PropertiesFile:
    def all_of(part: str) -> tuple:  # type: ignore[type-arg]
        return tuple(x for f in files for x in getattr(f, part))

    return PropertiesFile(*(all_of(part) for part in ("constants", "formulas", "labels", "properties")))


def _read(path: str) -> Texts:
    try:
        return Texts(parse_properties_file(Path(path)))
    except SyntaxFault as fault:
        return _without(fault)


def _parsed(text: str) -> Texts:
    try:
        return Texts(parse_properties(text, "-pf"))
    except SyntaxFault as fault:
        return _without(fault)


def _without(fault: SyntaxFault) -> Texts:
    """What is left of a text without the parts, between semicolons, that have a fault. Raises the fault if that is nothing."""
    source = fault.diagnostics[0].span.source
    text, wrong, declarations = source.text, dict[int, Broken](), list[SyntaxFault]()
    for start, end in _parts(source.text):
        own = [d for d in fault.diagnostics if start <= d.span.start < end]
        if not own:
            continue
        blank = re.sub(r"\S", " ", text[start:end])
        bare = _COMMENT.sub(lambda m: " " * len(m[0]), text[start:end]).removesuffix(";")
        if _DECLARATION.match(bare) or not bare.strip():
            declarations.append(SyntaxFault(*own))
        else:
            at = len(bare) - len(bare.lstrip())
            blank = f"{blank[:at]}0{blank[at + 1 : -1]}" + (";" if at + 1 < end - start else "")
            wrong[start + at] = Broken(" ".join(bare.split()), SyntaxFault(*own))
        text = text[:start] + blank + text[end:]
    try:
        left = parse_properties(text, source.name)
    except SyntaxFault:
        raise fault from None
    found = {i: wrong[p.span.start] for i, p in enumerate(left.properties) if p.span.start in wrong}
    if len(found) == len(left.properties) or len(found) < len(wrong):
        raise fault
    return Texts(left, found, declarations)


def _parts(text: str) -> Iterator[tuple[int, int]]:
    """Where the parts of a text begin and end, semicolon included; the last ends behind the text."""
    start = 0
    for word in _WORDS.finditer(text):
        if word[0] == ";":
            yield start, word.end()
            start = word.end()
    yield start, len(text) + 1
