"""The properties of a run, from a file and from texts.

Those that do not follow the grammar are reported in their place.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path

from symcheck.errors import Diagnostic, Source, Span, SymcheckError, SyntaxFault
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import (
    is_jani,
    parse_jani_file,
    parse_properties,
    parse_properties_file,
)
from symcheck.syntax.tree_builder import comments_above

__all__ = ["PropertiesInput", "UnparsedProperty", "read_properties"]

_WORDS = re.compile(r'//[^\n]*|"[^"\n]*"?|;')
_DECLARATION = re.compile(r"\s*(?:const|label|formula)\b")
_COMMENT = re.compile(r"//[^\n]*")


@dataclass(frozen=True)
class UnparsedProperty:
    """A property that does not follow the grammar, or that JANI has and symcheck has not.

    Attributes:
        text: on one line; of a JANI file its name.
        fault: why there is no property.
        span: where it stands.
        comments: the comment lines directly above.
    """

    text: str
    fault: SymcheckError
    span: Span
    comments: Sequence[str] = ()


@dataclass(frozen=True)
class PropertiesInput:
    """All properties of a run, in order.

    Attributes:
        file: the parsed properties, with the number 0 in the place of each unparsed one.
        unparsed: those that do not follow the grammar, by their index.
        declarations: faults of constants, labels and formulas, which `file` omits.
    """

    file: PropertiesFile
    unparsed: Mapping[int, UnparsedProperty] = field(default_factory=dict)
    declarations: Sequence[SyntaxFault] = ()


def read_properties(
    path: str | Path | None, texts: Sequence[str], name: str = "<properties>"
) -> PropertiesInput:
    """The properties of a file, followed by those of some texts.

    Args:
        path: the file, or None.
        texts: the texts.
        name: what messages call them.

    Raises:
        UsageError: the file cannot be read.
        SyntaxFault: no property of a text follows the grammar.
    """
    parts = [] if path is None else [_file(path)]
    parts += [_parsed(partial(parse_properties, text, name)) for text in texts]
    unparsed: dict[int, UnparsedProperty] = {}
    count = 0
    for part in parts:
        unparsed |= {count + i: fault for i, fault in part.unparsed.items()}
        count += len(part.file.properties)
    declarations = [fault for part in parts for fault in part.declarations]
    return PropertiesInput(_joined([part.file for part in parts]), unparsed, declarations)


def _file(path: str | Path) -> PropertiesInput:
    if not is_jani(path):
        return _parsed(partial(parse_properties_file, Path(path)))
    parsed = parse_jani_file(path)
    unparsed = {}
    for i, fault in parsed.faults.items():
        given = parsed.properties.properties[i]
        unparsed[i] = UnparsedProperty(given.name or f"{i + 1}", fault, given.span)
    return PropertiesInput(parsed.properties, unparsed)


def _joined(files: Sequence[PropertiesFile]) -> PropertiesFile:
    return PropertiesFile(
        tuple(chain.from_iterable(f.constants for f in files)),
        tuple(chain.from_iterable(f.formulas for f in files)),
        tuple(chain.from_iterable(f.labels for f in files)),
        tuple(chain.from_iterable(f.properties for f in files)),
    )


def _parsed(parse: Callable[[], PropertiesFile]) -> PropertiesInput:
    try:
        return PropertiesInput(parse())
    except SyntaxFault as fault:
        return _without_faults(fault)


def _without_faults(fault: SyntaxFault) -> PropertiesInput:
    """The properties of a text without its faulty parts. Raises the fault if none is left.

    A parser reports one fault per line: the remaining text is parsed again until no part has a
    fault.
    """
    source = fault.diagnostics[0].span.source
    parts = list(_parts(source.text))
    text, current = source.text, fault
    removed: dict[int, UnparsedProperty] = {}
    declarations: list[SyntaxFault] = []
    for _ in parts:
        for start, end in parts:
            moved = [_moved(d, source) for d in current.diagnostics if start <= d.span.start < end]
            if moved:
                whole = source.text[start:end]
                blank, offset = _blank(whole)
                text = text[:start] + blank + text[end:]
                if offset is None:
                    declarations.append(SyntaxFault(*moved))
                else:
                    removed[start + offset] = UnparsedProperty(
                        " ".join(_bare(whole).split()),
                        SyntaxFault(*moved),
                        moved[0].span,
                        comments_above(source.text, start + offset),
                    )
        try:
            file = parse_properties(text, source.name, shown=source.text)
            break
        except SyntaxFault as another:
            current = another
    else:
        raise fault
    unparsed = {
        i: removed[p.span.start] for i, p in enumerate(file.properties) if p.span.start in removed
    }
    if len(unparsed) == len(file.properties) or len(unparsed) < len(removed):
        raise fault
    return PropertiesInput(file, unparsed, declarations)


def _moved(diagnostic: Diagnostic, source: Source) -> Diagnostic:
    """The same fault, with its place in the original text."""
    return replace(diagnostic, span=Span(source, diagnostic.span.start, diagnostic.span.end))


def _bare(part: str) -> str:
    """A part without its semicolon, and with blanks for its comments."""
    return _COMMENT.sub(lambda m: " " * len(m[0]), part).removesuffix(";")


def _blank(part: str) -> tuple[str, int | None]:
    """A blank part of the same length, with a 0 in the place of a property, and its index."""
    blank, bare = re.sub(r"\S", " ", part), _bare(part)
    if _DECLARATION.match(bare) or not bare.strip():
        return blank, None
    at = len(bare) - len(bare.lstrip())
    return f"{blank[:at]}0{blank[at + 1 : -1]}" + (";" if at + 1 < len(part) else ""), at


def _parts(text: str) -> Iterator[tuple[int, int]]:
    """Start and end of each part, semicolon included; the last ends one behind the text."""
    start = 0
    for word in _WORDS.finditer(text):
        if word[0] == ";":
            yield start, word.end()
            start = word.end()
    yield start, len(text) + 1
