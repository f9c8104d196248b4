"""Models parsed piece by piece: while a text is typed, only the changed module is parsed anew."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault
from symcheck.syntax.declarations import Program
from symcheck.syntax.parse import parse_model

__all__ = ["Pieces", "parse_pieces"]

_BRACKET = re.compile(r'//[^\r\n]*|"[^"\r\n]*"|(?<!\w)(?:end)?module(?!\w)')


@dataclass(frozen=True, eq=False)
class Pieces:
    """A model whose modules have texts, and so places, of their own.

    Attributes:
        program: its syntax tree.
        whole: the whole text.
        starts: where the text of each module starts in the whole text, by the id of its source.
    """

    program: Program
    whole: Source
    starts: dict[int, int]

    def placed(self, found: Diagnostic) -> Diagnostic:
        """A fault of the model, with its place in the whole text."""
        if not found.span.source.text:  # of no place
            return found
        start = self.starts.get(id(found.span.source), 0)
        span = Span(self.whole, found.span.start + start, found.span.end + start)
        return replace(found, span=span)


def parse_pieces(text: str, name: str) -> Pieces:
    """Parse a model as `parse_model` does, from which only the places of its nodes differ.

    Raises SyntaxFault, with places in the whole text.
    """
    whole = Source(name, text)
    places = list(_modules(text))
    if len({text[start:end] for start, end in places}) < len(places):  # twice the same one
        places = []
    rest = text
    for start, end in places:
        rest = rest[:start] + " " * (end - start) + rest[end:]
    try:
        modules = [(start, _module(text[start:end], name)) for start, end in places]
        program = parse_model(rest, name)
    except SyntaxFault:  # faults next to each other are told together
        modules, program = [], parse_model(text, name)
    found = (*program.modules, *(m for _, piece in modules for m in piece.modules))
    starts = {id(piece.span.source): start for start, piece in modules}
    return Pieces(replace(program, modules=found, span=Span(whole, 0, len(text))), whole, starts)


@lru_cache(1000)
def _module(text: str, name: str) -> Program:
    return parse_model(text, name)


def _modules(text: str) -> Iterator[tuple[int, int]]:
    """The places of the modules of a text; of none from the first on that has no end."""
    start: int | None = None
    for match in _BRACKET.finditer(text):
        match match[0], start:
            case "module", None:
                start = match.start()
            case "endmodule", int():
                yield start, match.end()
                start = None
            case "module" | "endmodule", _:
                return
            case _:  # a comment, or a name in quotes
                pass
