"""A properties text of which some parts do not follow the grammar: the others are parsed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace

from symcheck.errors import Diagnostic, InputError, Span, SymcheckError, SyntaxFault
from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.ast import LETTERS
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_properties
from symcheck.syntax.tree_builder import comments_above

__all__ = ["PropertiesInput", "UnparsedProperty", "parse_properties_in_part"]

_WORDS = re.compile(r'//[^\n]*|"[^"\n]*"?|;|\n')
_BEGINNING = re.compile(
    r"""[ \t]*(?:
        (?:const|label|formula)\b
        | "\w+"[ \t]*:
        | <<
        | \[\[
        | (?:filter|multi|multilex|quantile)[ \t]*\(
        | [AE][ \t]*\[
        | (?:MEASURE)(?:min|max)*[ \t]*(?:\{[^\n}]*\}(?:[ \t]|min|max)*)?(?:=[ \t]*\?|[<>])
    )""".replace("MEASURE", "|".join((*LETTERS, "LRA"))),
    re.VERBOSE,
)
"""The beginning of a property or declaration on a line of its own."""
_GOES_ON = re.compile(r"(?:[\[({,:?&|!=<>+*/^-]|\b[XFGUWR])$")
"""The end of a line that needs another one."""
_DECLARATION = re.compile(
    r"\s*(?:const\b(?:\s+(?:int|double|bool)\b)?|label\b|formula\b)(?:\s+([A-Za-z_]\w*|\"\w+\"))?"
)
_NAME = re.compile(r"\s*(\"\w+\")\s*:")
_COMMENT = re.compile(r"//[^\n]*")
_INK = re.compile(r"\S")


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
    """All properties of a text or a run, in order.

    Attributes:
        file: the parsed properties, with the number 0 in the place of each unparsed one.
        unparsed: those that do not follow the grammar, by their index.
        declarations: faults of constants, labels and formulas, which `file` omits.
    """

    file: PropertiesFile
    unparsed: Mapping[int, UnparsedProperty] = field(default_factory=dict)
    declarations: Sequence[SyntaxFault] = ()

    @property
    def parsed(self) -> PropertiesFile:
        """The properties that follow the grammar, alone."""
        whole = enumerate(self.file.properties)
        return replace(self.file, properties=tuple(p for i, p in whole if i not in self.unparsed))

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """All that does not follow the grammar, in the order of the text."""
        faults = [*self.declarations, *(p.fault for p in self.unparsed.values())]
        found = [d for f in faults if isinstance(f, InputError) for d in f.diagnostics]
        return sorted(found, key=lambda d: d.span.start)


def parse_properties_in_part(text: str, name: str = "<properties>") -> PropertiesInput:
    """Parse a properties text as `parse_properties` does, of which some parts may be faulty.

    Each part is parsed on its own: a bracket that one of them leaves open concerns no other.

    Args:
        text: The whole text.
        name: What diagnostics call the text, such as its file name.

    Returns:
        The properties, and what is wrong with those that do not follow the grammar.

    Raises:
        SyntaxFault: The text is that of a model, or its faults are not those of single parts.

    Examples:
        >>> found = parse_properties_in_part("P=? [ F x=1 ]; P=? [ F x= ]")
        >>> len(found.parsed.properties), found.unparsed[1].text
        (1, 'P=? [ F x= ]')
    """
    try:
        return PropertiesInput(parse_properties(text, name))
    except SyntaxFault as fault:
        found = _without_faults(text, name, fault)
        if fault.diagnostics[0].code == "model" and not found.parsed.properties:
            raise
        return found


def _without_faults(whole: str, name: str, fault: SyntaxFault) -> PropertiesInput:
    """The properties of a text with a fault without its faulty parts."""
    text = whole
    removed: dict[int, UnparsedProperty] = {}
    declarations: list[SyntaxFault] = []
    faulty: list[tuple[str, InputError]] = []
    for start, end in _parts(whole):
        part = whole[start:end]
        own = _fault_of(part, start, whole, name)
        if own is not None:
            blank, offset = _blank(part)
            text = text[:start] + blank + text[end:]
            if offset is None:
                declarations.append(own)
                if (declared := _DECLARATION.match(_bare(part))) and declared[1]:
                    faulty.append((declared[1], own))
            else:
                bare = _bare(part).rstrip()
                if named := _NAME.match(bare):
                    faulty.append((named[1], own))
                removed[start + offset] = UnparsedProperty(
                    " ".join(bare.split()),
                    own,
                    Span(own.diagnostics[0].span.source, start + offset, start + len(bare)),
                    comments_above(whole, start + offset),
                )
    try:
        file = replace(parse_properties(text, name, shown=whole), faulty=tuple(faulty))
    except SyntaxFault:
        raise fault from None
    unparsed = {
        i: removed[p.span.start] for i, p in enumerate(file.properties) if p.span.start in removed
    }
    if len(unparsed) < len(removed):
        raise fault
    return PropertiesInput(file, unparsed, declarations)


def _fault_of(part: str, start: int, whole: str, name: str) -> SyntaxFault | None:
    """The fault of a part of a text, with its place in the whole; None if it has none."""
    try:
        parse_properties(part)
    except SyntaxFault:  # only this one costs the reading of a text as long as the whole
        before, after = whole[:start], whole[start + len(part) :]
        try:
            parse_properties(f"{_spaces(before)}{part}{_spaces(after)}", name, shown=whole)
        except SyntaxFault as fault:
            return fault
    return None


def _spaces(text: str) -> str:
    """A blank text of the same length."""
    return _INK.sub(" ", text)


def _bare(part: str) -> str:
    """A part without its semicolon, and with blanks for its comments."""
    return _COMMENT.sub(lambda m: " " * len(m[0]), part).removesuffix(";")


def _blank(part: str) -> tuple[str, int | None]:
    """A blank part of the same length, with a 0 in the place of a property, and its index."""
    blank, bare = _spaces(part), _bare(part)
    if _DECLARATION.match(bare) or not bare.strip():
        return blank, None
    at = len(bare) - len(bare.lstrip())
    return f"{blank[:at]}0{blank[at + 1 : -1]}" + (";" if at + 1 < len(part) else ""), at


def _parts(text: str) -> Iterator[tuple[int, int]]:
    """Start and end of each part, semicolon included; the last ends one behind the text.

    A property may end without a semicolon: a line begins another part if it starts as a property or
    declaration does, and the line before it is empty or does not ask for more.
    """
    start = 0
    for word in _WORDS.finditer(text):
        end = word.end()
        if word[0] == "\n":
            bare = _bare(text[start : word.start()])
            whole = bare.rstrip()
            asks = _GOES_ON.search(whole) and "\n" not in bare[len(whole) :]
            if not whole or asks or not _BEGINNING.match(text, end):
                continue
            end = start + len(whole)  # the comments belong to what follows
        elif word[0] != ";":
            continue
        yield start, end
        start = end
    yield start, len(text) + 1
