"""The words of a text in one of the languages.

Lark's own lexer takes longer than all that is done with its words: it tries each terminal by itself
and counts lines. Here one regular expression finds a word, and a table tells a keyword or a sign.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from symcheck.lazy_dataclass import dataclass

__all__ = ["IDENTIFIERS", "SIGNS", "Lexer", "Word"]

IDENTIFIERS, SIGNS = "NAME", "SIGN"
"""The groups of a word that may be a keyword, and of a sign."""


@dataclass(slots=True)
class Word:
    """A word of a text. It is not frozen: that takes thrice the time.

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
    """What finds the words of a text.

    Args:
        word: the regular expression of a word, with a group for each terminal of several spellings.
        keywords, signs: the terminals of words with one spelling.
    """

    def __init__(self, word: str, keywords: Mapping[str, str], signs: Mapping[str, str]) -> None:
        self._word, self._keywords, self._signs = re.compile(word), keywords, signs

    def words(self, text: str) -> Iterator[Word]:
        """The words of a text. Every character belongs to one, or to the space between."""
        keywords, signs = self._keywords, self._signs
        for match in self._word.finditer(text):
            kind = match.lastgroup
            if kind is None:  # the end of the text
                return
            start, end = match.span(kind)
            value = text[start:end]
            if kind == SIGNS:
                kind = signs[value]
            elif kind == IDENTIFIERS:
                kind = keywords.get(value, kind)
            yield Word(kind, value, start, end)
