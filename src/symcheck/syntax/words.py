"""The words of a text in one of the languages.

Lark's own lexer takes longer than all that is done with its words: it tries each terminal by itself
and counts lines. Here one regular expression finds a word, and a table tells a keyword or a sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lark.lexer import PatternStr, TerminalDef

__all__ = ["Lexer", "Word"]

_IDENTIFIERS, _SIGNS = "NAME", "SIGN"


@dataclass(slots=True)
class Word:
    """A word of a text, as Lark's parser takes it. It is not frozen: that takes thrice the time.

    Attributes:
        type: its terminal in the grammar, such as 'NAME'.
        value: its characters.
        start_pos, end_pos: the offsets of its first character, and of the one behind it.
    """

    type: str
    value: str
    start_pos: int
    end_pos: int


class Lexer:
    """The terminals of a grammar as one regular expression.

    The words are those of Lark's basic lexer: the terminals with the highest priority come first,
    and a terminal with one spelling wins over `NAME`.

    Args:
        terminals: those of the grammar.
        ignored: the name of the one that stands between words.
    """

    def __init__(self, terminals: Iterable[TerminalDef], ignored: str) -> None:
        order = sorted(terminals, key=lambda t: (-t.priority, -t.pattern.max_width, t.name))
        patterns = {t.name: t.pattern.to_regexp() for t in order}
        identifier = re.compile(patterns[_IDENTIFIERS])
        fixed = {t.pattern.value: t.name for t in order if isinstance(t.pattern, PatternStr)}
        self._keywords = {w: kind for w, kind in fixed.items() if identifier.fullmatch(w)}
        self._signs = {w: kind for w, kind in fixed.items() if w not in self._keywords}
        first = [t.name for t in order if t.name not in fixed.values() and t.priority >= 0]
        last = [t.name for t in order if t.name not in fixed.values() and t.priority < 0]
        signs = "|".join(map(re.escape, sorted(self._signs, key=len, reverse=True)))
        groups = [
            *(f"(?P<{name}>{patterns[name]})" for name in first if name != ignored),
            f"(?P<{_SIGNS}>{signs})",
            *(f"(?P<{name}>{patterns[name]})" for name in last),
        ]
        self._word = re.compile(rf"(?:{patterns[ignored]})?(?:{'|'.join(groups)}|\Z)")

    def words(self, text: str) -> Iterator[Word]:
        """The words of a text. Every character belongs to one, or to the space between."""
        keywords, signs = self._keywords, self._signs
        for match in self._word.finditer(text):
            kind = match.lastgroup
            if kind is None:  # the end of the text
                return
            start, end = match.span(kind)
            value = text[start:end]
            if kind == _SIGNS:
                kind = signs[value]
            elif kind == _IDENTIFIERS:
                kind = keywords.get(value, kind)
            yield Word(kind, value, start, end)
