"""A parser that the tables of a grammar drive.

Lark analyses the grammars. Its own parser takes as long to start as numpy, because it makes an
object of each action.

Source: Aho, Lam, Sethi and Ullman, Compilers (2007), 4.5.3 and 4.7.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from symcheck.syntax.words import Word

__all__ = ["END", "Method", "Parser", "Rule", "Tables"]

END = "$END"
"""The terminal of the end of a text."""

Method = Callable[[list[Any]], Any]
"""What makes the value of a rule from the values of its symbols."""


class Rule(NamedTuple):
    """A rule of a grammar.

    Attributes:
        symbol: what it defines.
        size: the number of its symbols.
        method: the name of the builder's method that makes its value. Without such a method, the
            value is the list of values.
        is_transparent: a single value is that of the rule, and the method is not called.
        parts: the values that the method gets, unless they are those of the symbols: the index of
            a symbol, or None for an absent option, and whether the value is a list whose items
            take its place.
    """

    symbol: str
    size: int
    method: str
    is_transparent: bool
    parts: tuple[tuple[int | None, bool], ...] | None


class Tables(NamedTuple):
    """What a grammar is for the parser, in types that `marshal` writes.

    Attributes:
        word, keywords, signs: what the lexer needs.
        reserved: the regular expression of what is no name.
        states: by state, what is done at each symbol: the next state, or `~rule` that ends there.
        rules: the attributes of each `Rule`.
        starts: by start symbol, the first state and the last one.
    """

    word: str
    keywords: dict[str, str]
    signs: dict[str, str]
    reserved: str
    states: list[dict[str, int]]
    rules: list[tuple[Any, ...]]
    starts: dict[str, tuple[int, int]]


class Parser:
    """A parser behind some words of a text.

    Args:
        tables: those of the grammar.
        methods: by rule, what makes its value; None: there are no values but words and lists.
        start: a start symbol.
    """

    __slots__ = "_end", "_methods", "_stack", "_tables", "values"

    def __init__(self, tables: Tables, methods: list[Method] | None, start: str) -> None:
        first, self._end = tables.starts[start]
        self._tables, self._methods = tables, methods
        self._stack = [first]
        self.values: list[Any] = []

    def copy(self, *, with_values: bool = True) -> Parser:
        """A parser in the same state. It shares the values: a text with faults does not need them.

        Args:
            with_values: whether it calls the methods; otherwise it only tells which words fit.
        """
        other = object.__new__(Parser)
        other._end, other._tables = self._end, self._tables
        other._methods = self._methods if with_values else None
        other._stack, other.values = self._stack.copy(), self.values.copy()
        return other

    def feed(self, word: Word) -> bool:
        """Read the next word; at the end of the text, `values` has that of the start symbol.

        Returns:
            Whether the word fits. If not, rules that end before it may have been applied.
        """
        states, rules, methods = self._tables.states, self._tables.rules, self._methods
        stack, values, kind = self._stack, self.values, word.type
        while (action := states[stack[-1]].get(kind)) is not None:
            if action >= 0:
                stack.append(action)
                values.append(word)
                return True
            symbol, size, _, is_transparent, parts = rules[~action]
            given: list[Any] = values[-size:] if size else []
            if size:
                del stack[-size:], values[-size:]
            if methods is None:
                values.append(given)
            else:
                if parts is not None:
                    given = _selected(given, parts)
                single = is_transparent and len(given) == 1
                values.append(given[0] if single else methods[~action](given))
            stack.append(states[stack[-1]][symbol])
            if kind == END and stack[-1] == self._end:
                return True
        return False

    def accepted(self) -> frozenset[str]:
        """The terminals that can come next."""
        return frozenset(
            symbol
            for symbol in self._tables.states[self._stack[-1]]
            if symbol.isupper() and self.copy(with_values=False).feed(Word(symbol, "", 0, 0))
        )


def _selected(values: list[Any], parts: tuple[tuple[int | None, bool], ...]) -> list[Any]:
    """The values that a method gets. A list that comes first grows in place, and not in squares."""
    result: list[Any] = []
    for index, is_list in parts:
        if index is None:
            result.append(None)
        elif not is_list:
            result.append(values[index])
        elif result:
            result += values[index]
        else:
            result = values[index]
    return result
