"""The words of a text, whether it follows the grammar or not."""

from __future__ import annotations

import re

from symcheck.syntax.grammars import load
from symcheck.syntax.words import Word

__all__ = ["comments", "words"]

_COMMENT = re.compile(r"//[^\r\n]*")


def words(text: str, language: str) -> list[Word]:
    """The words of a text in a language, 'prism' or 'properties'.

    Every character belongs to a word, a comment or the space between: a text has words whatever its
    faults are.

    Examples:
        >>> [word.value for word in words("x>=2 // two", "properties")]
        ['x', '>=', '2']
    """
    return list(load(language).lexer.words(text))


def comments(text: str) -> list[tuple[int, int]]:
    """Where comments stand: the offsets of their beginnings and ends."""
    return [match.span() for match in _COMMENT.finditer(text)]
