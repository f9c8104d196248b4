"""The properties of a run, from a file and from -pf: what does not follow the grammar is left out, and reported in its place."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault
from symcheck.syntax.declarations import PropertiesFile
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
    return Texts(
        _joined([p.file for p in parts]), broken, [f for p in parts for f in p.declarations]
    )


def _joined(files: Sequence[PropertiesFile]) -> PropertiesFile:
    def all_of(part: str) -> tuple:  # type: ignore[type-arg]
        return tuple(x for f in files for x in getattr(f, part))

    return PropertiesFile(
        *(all_of(part) for part in ("constants", "formulas", "labels", "properties"))
    )


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
    """What is left of a text without the parts, between semicolons, that have a fault. Raises the fault if that is nothing.

    A parser tells of one fault a line: what is left is parsed again until no part is at fault.
    """
    source = fault.diagnostics[0].span.source
    parts = list(_parts(source.text))
    text, wrong, declarations, found = source.text, dict[int, Broken](), list[SyntaxFault](), fault
    for _ in parts:
        for start, end in parts:
            own = [_moved(d, source) for d in found.diagnostics if start <= d.span.start < end]
            if own:
                whole = source.text[start:end]
                blank, place = _blank(whole)
                text = text[:start] + blank + text[end:]
                if place is None:
                    declarations.append(SyntaxFault(*own))
                else:
                    wrong[start + place] = Broken(" ".join(_bare(whole).split()), SyntaxFault(*own))
        try:
            left = parse_properties(text, source.name)
            break
        except SyntaxFault as another:
            found = another
    else:
        raise fault
    broken = {
        i: wrong[p.span.start] for i, p in enumerate(left.properties) if p.span.start in wrong
    }
    if len(broken) == len(left.properties) or len(broken) < len(wrong):
        raise fault
    return Texts(left, broken, declarations)


def _moved(diagnostic: Diagnostic, source: Source) -> Diagnostic:
    """The same, pointing into the text as it was written."""
    return replace(diagnostic, span=Span(source, diagnostic.span.start, diagnostic.span.end))


def _bare(part: str) -> str:
    """A part without its comments and its semicolon; as long as before, or shorter by that."""
    return _COMMENT.sub(lambda m: " " * len(m[0]), part).removesuffix(";")


def _blank(part: str) -> tuple[str, int | None]:
    """A part of the same length that says nothing; in the place of a property stands the number 0, and where that is."""
    blank, bare = re.sub(r"\S", " ", part), _bare(part)
    if _DECLARATION.match(bare) or not bare.strip():
        return blank, None
    at = len(bare) - len(bare.lstrip())
    return f"{blank[:at]}0{blank[at + 1 : -1]}" + (";" if at + 1 < len(part) else ""), at


def _parts(text: str) -> Iterator[tuple[int, int]]:
    """Where the parts of a text begin and end, semicolon included; the last ends behind the text."""
    start = 0
    for word in _WORDS.finditer(text):
        if word[0] == ";":
            yield start, word.end()
            start = word.end()
    yield start, len(text) + 1
