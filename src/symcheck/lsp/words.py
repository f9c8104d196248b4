"""The words of a text, whether it follows the grammar or not."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from symcheck.syntax.grammars import load

__all__ = ["Word", "comments", "keywords", "words"]

_COMMENT = re.compile(r"//[^\r\n]*")


@dataclass(frozen=True, slots=True)
class Word:
    """A word of a text.

    Attributes:
        kind: its terminal in the grammar, such as 'NAME'.
        text: its characters.
        start, end: the offsets of its first character, and of the one behind it.
    """

    kind: str
    text: str
    start: int
    end: int


def words(text: str, language: str) -> list[Word]:
    """The words of a text in a language, 'prism' or 'properties'.

    Every character belongs to a word, a comment or the space between: a text has words whatever its
    faults are.

    Examples:
        >>> [word.text for word in words("x>=2 // two", "properties")]
        ['x', '>=', '2']
    """
    return [
        Word(token.type, str(token.value), token.start_pos or 0, token.end_pos or 0)
        for token in load(language).parser.lex(text)
    ]


def comments(text: str) -> list[tuple[int, int]]:
    """Where comments stand: the offsets of their beginnings and ends."""
    return [match.span() for match in _COMMENT.finditer(text)]


@cache
def keywords(language: str) -> tuple[str, ...]:
    """The words that a language reserves, in alphabetical order."""
    return tuple(sorted({w for w in load(language).spelling.values() if w[0].isalpha()}))
