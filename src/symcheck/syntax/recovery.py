"""Reads a text once, and finds several faults of one that does not follow the grammar.

The parser reads the text word by word, and its state at the last complete part of the text is kept.
After a fault, reading goes on in one of three ways: a missing word is put in; a repeated sign is
left out; or the words up to the next semicolon or keyword are left out, and the parser returns to
that state.

Source: panic mode, Aho, Lam, Sethi and Ullman, Compilers (2007), 4.8.3.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import accumulate, chain, islice
from typing import Any

from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.grammars import Language
from symcheck.syntax.lalr import END, Parser
from symcheck.syntax.words import Word

__all__ = ["FOREIGN", "RESERVED", "Fault", "Place", "place_at_end", "read_text"]

FOREIGN = "FOREIGN"
"""The terminal of a character that starts no word of the language."""

RESERVED = "RESERVED"
"""The terminal of a word that is reserved, but has no place in this kind of text."""

_SEMICOLON = "SEMICOLON"
_MOST_FAULTS = 20
_MISSING = (
    *("SEMICOLON", "RPAR", "RSQB", "RBRACE", "COLON", "QUOTE"),
    *("ENDMODULE", "ENDREWARDS", "ENDINIT", "ENDSYSTEM"),
)
"""The words that are put in where one of them is missing, in the order in which they are tried."""

_MOST_WORDS_AROUND = 1000
"""At most so many words before a fault are read again, to find what was expected, and so many
behind it are looked at.
"""

_BLOCKS = {"MODULE": "ENDMODULE", "REWARDS": "ENDREWARDS"}
_ENDS = frozenset({"SEMICOLON", "ENDMODULE", "ENDREWARDS", "ENDINIT", "ENDSYSTEM"}) | {
    *("DTMC", "CTMC", "MDP", "PROBABILISTIC", "STOCHASTIC", "NONDETERMINISTIC")
}
_LANDMARKS = _ENDS | {*_BLOCKS}
"""The words after which it is noted where reading is, as it is after the names of modules."""
_BEGINNINGS = frozenset(
    {
        *("CONST", "RATE", "PROB", "FORMULA", "GLOBAL", "LABEL", "MODULE", "ENDMODULE", "REWARDS"),
        *("ENDREWARDS", "INIT", "SYSTEM", "DTMC", "CTMC", "MDP", "LSQB"),
        *("P", "PMIN", "PMAX", "RELEASE", "RMIN", "RMAX", "S", "FILTER", "MULTI", "STRING"),
        *("COALITION", "STEADY", "TIME"),
    }
)
"""The words that begin a part of a text, if they stand first on their line."""


@dataclass(frozen=True, slots=True)
class Fault:
    """`token` does not fit: one of the terminals `expected` should stand there.

    `before` has the words since the last semicolon, which is the first of them. `after` has the
    words that follow, up to the next semicolon, but not too many. `mended` is the terminal that was
    put in before `token`; `is_enclosed`: it is the end of a module, which is ended behind `token`.
    """

    token: Word
    before: tuple[Word, ...]
    after: tuple[Word, ...]
    expected: frozenset[str]
    mended: str | None
    is_enclosed: bool

    @property
    def start(self) -> int:
        """Where the word begins in the text."""
        return self.token.start_pos

    @property
    def end(self) -> int:
        """Where the word ends."""
        return self.token.end_pos

    @property
    def previous(self) -> int:
        """Where the word before it ends."""
        return self.before[-1].end_pos if self.before else 0

    @property
    def last(self) -> str:
        """The word before it."""
        return str(self.before[-1].value) if self.before else ""

    @property
    def last_but_one(self) -> str:
        """The word before that one."""
        return str(self.before[-2].value) if len(self.before) > 1 else ""


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a text: one of the terminals `expected` can stand there.

    `open` has the words before it that belong to what is not complete, such as `module` and its
    name within a module.
    """

    expected: frozenset[str]
    open: tuple[Word, ...]


def place_at_end(language: Language, start: str, text: str) -> Place:
    """The place at the end of a text that may have faults. No builder is called.

    Examples:
        >>> from symcheck.syntax.grammars import load
        >>> place = place_at_end(load("prism"), "program", "module m x : ")
        >>> sorted(place.expected), [word.value for word in place.open]
        (['BOOL', 'CLOCK', 'INT', 'LSQB'], ['module', 'm', 'x', ':'])
    """
    return _Placing(language, start, text).place()


def read_text(language: Language, start: str, text: str) -> tuple[Any, list[Fault]]:
    """The value of a text, and its faults, in its order; with faults, the value has no meaning.

    The language's builder notes what else is wrong.
    """
    reading = _Reading(language, start, text)
    faults = reading.run()
    return reading.value, faults


class _Words:
    """The words of a text with a view ahead. The last one is empty: the end of the text."""

    def __init__(self, language: Language, text: str) -> None:
        end = Word(END, "", len(text), len(text))
        self._rest: Iterator[Word] = chain(language.lexer.words(text), (end,))
        self._ahead: deque[Word] = deque()

    def next(self) -> Word:
        return self._ahead.popleft() if self._ahead else next(self._rest)

    def put_back(self, token: Word) -> None:
        self._ahead.appendleft(token)

    def peek(self) -> Word | None:
        """The next word; None behind the last one."""
        if not self._ahead:
            self._ahead.extend(islice(self._rest, 1))
        return self._ahead[0] if self._ahead else None

    def statement(self) -> tuple[Word, ...]:
        """The next words up to a semicolon, if there are not too many. They stay ahead."""
        result: list[Word] = []
        while self.peek() and not (result and result[-1].type == _SEMICOLON):
            if len(result) == _MOST_WORDS_AROUND:
                break
            result.append(self.next())
        self._ahead.extendleft(reversed(result))
        return tuple(result)


class _Reading:
    """One reading of a text, which may have faults.

    value: that of the text, once it is complete.
    """

    def __init__(self, language: Language, start: str, text: str) -> None:
        self.value: Any = None
        self._text = text
        self._words = _Words(language, text)
        self._parser = language.parser(start)
        self._resumes = start != "state"
        # The parser at the last complete part of the text and at the last one outside of blocks.
        self._part = self._outside = self._parser.copy()
        self._in_block = False
        # The words since the last semicolon, and the parser before those from a position on.
        self._before: list[Word] = []
        self._anchor, self._anchored = self._part, 0

    def run(self) -> list[Fault]:
        faults: list[Fault] = []
        while len(faults) < _MOST_FAULTS and (token := self._read()) is not None:
            fault = self._fault(token)
            faults.append(fault)
            if not self._mend(fault):
                break
        return faults

    def _read(self) -> Word | None:
        """Read up to a word that does not fit, and return it; None if the text is complete."""
        next_word, feed = self._words.next, self._parser.feed
        before, is_name = self._before, False
        while True:
            token = next_word()
            kind = token.type
            if not feed(token):
                return token
            if kind == END:
                self.value = self._parser.values[-1]
                return None
            before.append(token)
            if kind in _LANDMARKS or is_name or len(before) - self._anchored >= _MOST_WORDS_AROUND:
                self._note(kind)
                before = self._before
            is_name = kind in _BLOCKS

    def _pass(self, token: Word) -> None:
        """Note a word as one of those before the next fault."""
        if token.type == _SEMICOLON:
            self._before = []
        self._before.append(token)
        self._anchored = len(self._before)

    def _note(self, kind: str) -> None:
        """Keep the state of the parser, also as that of a part that the last word completes."""
        previous = self._before[-2].type if len(self._before) > 1 else ""
        if kind == _SEMICOLON:
            self._before = self._before[-1:]
        if kind in _BLOCKS:
            self._in_block = True
        elif kind in _BLOCKS.values():
            self._in_block = False
        self._anchor, self._anchored = self._parser.copy(), len(self._before)
        if (
            kind in _ENDS
            or kind == "REWARDS"
            or (previous, kind) in (("MODULE", "NAME"), ("REWARDS", "STRING"))
        ):
            self._part = self._anchor
            if not self._in_block:
                self._outside = self._part

    def _fault(self, token: Word) -> Fault:
        expected = self._parser_before_fault().accepted()
        after = self._words.statement()
        missing = self._missing((token, *after[:1]), expected)
        if missing == "RSQB" and _closes((token, *after)):
            missing = None  # it comes later
        enclosed = False
        if missing == "ENDMODULE" and token.type not in (END, "MODULE"):
            end = re.search(r"\b(end)?module\b", self._text[token.end_pos :])
            enclosed = end is not None and end[1] is not None
        return Fault(token, tuple(self._before), after, expected, missing, enclosed)

    def _parser_before_fault(self) -> Parser:
        """The parser behind the last words.

        Rules were applied before a word was refused, which hides some of the expected ones.
        """
        parser = self._anchor.copy(with_values=False)
        for word in self._before[self._anchored :]:
            parser.feed(word)
        return parser

    def _missing(self, following: tuple[Word, ...], expected: frozenset[str]) -> str | None:
        """The terminal of a single missing word with which the following words fit."""
        for kind in _MISSING:
            if kind in expected and self._fits((self._inserted(kind), *following)):
                return kind
        return None

    def _inserted(self, kind: str) -> Word:
        """An empty word behind the last one."""
        at = self._before[-1].end_pos if self._before else 0
        return Word(kind, "", at, at)

    def _fits(self, words: tuple[Word, ...]) -> bool:
        """Whether these words can come next."""
        parser = self._parser.copy(with_values=False)
        return all(parser.feed(word) for word in words)

    def _mend(self, fault: Fault) -> bool:
        """Change the words ahead or the state so that reading can go on. Returns whether it can."""
        if fault.is_enclosed:
            self._pass(fault.token)
            return self._skip(self._words.next(), (self._part,))
        if fault.mended is not None:
            self._words.put_back(fault.token)
            self._words.put_back(self._inserted(fault.mended))
            return True
        return self._is_repeated(fault) or self._skip(fault.token, (self._part, self._outside))

    def _is_repeated(self, fault: Fault) -> bool:
        """Whether the word repeats the sign before it, as in == and &&, and can be left out."""
        last = fault.before[-1] if fault.before else None
        return (
            last is not None
            and fault.token.type in ("EQ", "AND", "OR")
            and fault.token.type == last.type
            and fault.token.start_pos == last.end_pos
            and self._fits(fault.after[:1])
        )

    def _skip(self, token: Word, parsers: tuple[Parser, ...]) -> bool:
        """Leave out the rest of this part of the text. Returns whether another part follows, which
        is read by one of these parsers.
        """
        if not self._resumes:
            return False
        states = [(parser, parser.accepted()) for parser in parsers]
        while True:
            follower = self._words.peek()
            if token.type == _SEMICOLON and follower and self._resume(states, follower):
                self._pass(token)
                return True
            if (
                token.type == END or (token.type in _BEGINNINGS and self._is_first(token))
            ) and self._resume(states, token):
                self._words.put_back(token)
                return True
            if token.type == END:
                return False
            self._pass(token)
            token = self._words.next()

    def _resume(self, states: list[tuple[Parser, frozenset[str]]], token: Word) -> bool:
        """Go back to the first of these states in which the word can come next, if there is one."""
        for parser, accepted in states:
            if token.type in accepted:
                self._part = self._anchor = parser
                self._anchored = len(self._before)
                self._parser = parser.copy()
                self._in_block = self._in_block and parser is not self._outside
                return True
        return False

    def _is_first(self, token: Word) -> bool:
        """Whether no other word stands before this one on its line."""
        previous = self._before[-1].end_pos if self._before else 0
        return not self._before or "\n" in self._text[previous : token.start_pos]


class _Placing(_Reading):
    """A reading that stays where the text ends, also if a module, say, is not complete there."""

    def __init__(self, language: Language, start: str, text: str) -> None:
        super().__init__(language, start, text)
        self._parser = self._parser.copy(with_values=False)
        self._part = self._outside = self._anchor = self._parser.copy()

    def place(self) -> Place:
        while (token := self._read()) is not None and token.type != END:
            fault = self._fault(token)
            if _SEMICOLON in (word.type for word in (token, *fault.after)):
                self._mend(fault)
            else:
                self._mend_last(fault)
        parser = self._parser_before_fault()
        words = (value for value in parser.values if isinstance(value, Word))
        return Place(parser.accepted(), tuple(words))

    def _mend_last(self, fault: Fault) -> None:
        """Mend a fault of the last statement, of which no word is skipped that may be needed."""
        kind = fault.mended or ("NAME" if self._fits((self._inserted("NAME"), fault.token)) else "")
        if kind:
            self._words.put_back(fault.token)
            self._words.put_back(self._inserted(kind))

    def _resume(self, states: list[tuple[Parser, frozenset[str]]], token: Word) -> bool:
        if token.type == END:
            states = [(self._part, frozenset({END}))]
        return super()._resume(states, token)


def _closes(words: Sequence[Word]) -> bool:
    """Whether these words have a closing square bracket that none of them opens."""
    changes = ((word.type == "LSQB") - (word.type == "RSQB") for word in words)
    return any(still_open < 0 for still_open in accumulate(changes))
