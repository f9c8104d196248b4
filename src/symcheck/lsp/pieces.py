"""Models parsed piece by piece: while a text is typed, only the changed module is parsed anew."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault
from symcheck.syntax.declarations import Program
from symcheck.syntax.parse import parse_model

__all__ = ["Pieces", "parse_pieces"]

_DELIMITER = re.compile(r'//[^\r\n]*|"[^"\r\n]*"|(?<!\w)(?:end)?module(?!\w)')
"""What begins or ends a module, and what hides such words: comments and names in quotes."""
_HEAD = re.compile(r"module\s+\w+")


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
        if not found.span.source.text:  # it has no place in the text
            return found
        start = self.starts.get(id(found.span.source), 0)
        span = Span(self.whole, found.span.start + start, found.span.end + start)
        return replace(found, span=span)


def parse_pieces(text: str, name: str) -> Pieces:
    """Parse a model as `parse_model` does, from which only the places of its nodes differ.

    Of each module, the head and the end stay in the rest of the text: whether a module may stand
    there is seen from the rest, and what is within from the module.

    Raises SyntaxFault, with places in the whole text.
    """
    whole = Source(name, text)
    places = list(_modules(text))
    try:
        if len({text[start:end] for start, _, end in places}) < len(places):
            raise SyntaxFault  # two places for one source
        rest = parse_model(_without_bodies(text, places), name)
        modules = [(start, _module(text[start:end], name)) for start, _, end in places]
        if len(rest.modules) != len(modules):
            raise SyntaxFault
    except SyntaxFault:  # the whole text tells what is wrong, as a check does
        return Pieces(parse_model(text, name), whole, {})
    starts = {id(module.span.source): start for start, module in modules}
    found = tuple(m for _, module in modules for m in module.modules)
    return Pieces(replace(rest, modules=found, span=Span(whole, 0, len(text))), whole, starts)


def _without_bodies(text: str, places: Sequence[tuple[int, int, int]]) -> str:
    """The text with spaces in place of what stands between the head and the end of modules."""
    parts, at = [], 0
    for _, head, end in places:
        body = end - len("endmodule")
        parts += [text[at:head], " " * (body - head)]
        at = body
    return "".join([*parts, text[at:]])


@lru_cache(1000)
def _module(text: str, name: str) -> Program:
    return parse_model(text, name)


def _modules(text: str) -> Iterator[tuple[int, int, int]]:
    """Where modules start, where their heads (`module NAME`) end, and where they end; up to the
    first one that has no head or no end.
    """
    head: re.Match[str] | None = None
    for match in _DELIMITER.finditer(text):
        if match[0].startswith(("//", '"')):
            continue
        if match[0] == "endmodule" and head is not None:
            yield head.start(), head.end(), match.end()
            head = None
            continue
        if match[0] == "module" and head is None:
            head = _HEAD.match(text, match.start())
            if head is not None:
                continue
        return
