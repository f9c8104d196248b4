"""What the names of a text stand for: declarations and uses, found by the words around them.

They are found in a text with faults too, where no syntax tree is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

from symcheck.syntax.words import Word

__all__ = ["Kind", "Names", "Occurrence", "Symbol", "names_of"]


class Kind(Enum):
    """What a name stands for."""

    VARIABLE = "variable"
    CONSTANT = "constant"
    FORMULA = "formula"
    LABEL = "label"
    MODULE = "module"
    ACTION = "action"
    REWARDS = "reward structure"
    PROPERTY = "property"
    PLAYER = "player"


QUOTED = (Kind.LABEL, Kind.REWARDS, Kind.PROPERTY)
"""The kinds of what is named in quotes."""


@dataclass(frozen=True, slots=True)
class Symbol:
    """A declaration.

    Attributes:
        kind, name: what is declared.
        start, end: the offsets of the name.
        first, last: the offsets of the whole declaration.
        within: the module in which it stands; None elsewhere.
        copy_of: of a variable or module made by renaming, what it is a copy of.
    """

    kind: Kind
    name: str
    start: int
    end: int
    first: int
    last: int
    within: str | None = None
    copy_of: str | None = None


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A name in the text. `kinds` has what it may stand for there, the likeliest first."""

    name: str
    start: int
    end: int
    kinds: tuple[Kind, ...]


_VALUES = (Kind.VARIABLE, Kind.CONSTANT, Kind.FORMULA)
_RENAMED = (*_VALUES, Kind.ACTION)
_ENDS = {
    "module": "endmodule",
    "rewards": "endrewards",
    "init": "endinit",
    "system": "endsystem",
    "player": "endplayer",
    "observables": "endobservables",
    "invariant": "endinvariant",
}
_LAST = frozenset(_ENDS.values())
_NAMES = ("NAME", "FUNCTION", "STRING")
"""Terminals of words that may be names."""
_STATEMENTS = ("const", "formula", "label", "module", "rewards", "endmodule", "endrewards")
"""Words before which a declaration without its semicolon ends."""


@dataclass(frozen=True)
class Names:
    """The declarations of a text, and all names in it."""

    symbols: tuple[Symbol, ...]
    occurrences: tuple[Occurrence, ...]

    def declared(self, name: str, kinds: Sequence[Kind]) -> Symbol | None:
        """The declaration of a name as the first of these kinds that it has."""
        found = self._declared.get(name, {})
        return next((found[kind] for kind in kinds if kind in found), None)

    @cached_property
    def _declared(self) -> dict[str, dict[Kind, Symbol]]:
        """The first declaration of each kind, by name."""
        found: dict[str, dict[Kind, Symbol]] = {}
        for symbol in self.symbols:
            found.setdefault(symbol.name, {}).setdefault(symbol.kind, symbol)
        return found

    def at(self, offset: int) -> Occurrence | None:
        """The name that stands at an offset, or ends there."""
        return next((o for o in self.occurrences if o.start <= offset <= o.end), None)


def names_of(found: Sequence[Word], language: str) -> Names:
    """The names among the words of a model ('prism') or of a properties file ('properties').

    Examples:
        >>> from symcheck.lsp.words import words
        >>> text = "dtmc const int N = 3; module m x : [0..N]; endmodule"
        >>> found = names_of(words(text, "prism"), "prism")
        >>> [(symbol.kind.value, symbol.name) for symbol in found.symbols]
        [('constant', 'N'), ('module', 'm'), ('variable', 'x')]
    """
    reading = _Reading(found, language)
    reading.run()
    return Names(tuple(reading.symbols), tuple(reading.occurrences))


class _Reading:
    """One walk through the words; `block` is the block that is open."""

    def __init__(self, found: Sequence[Word], language: str) -> None:
        self.words, self.language = found, language
        self.symbols: list[Symbol] = []
        self.actions: set[str] = set()  # those that have symbols
        self.occurrences: list[Occurrence] = []
        self.block: str | None = None
        self.module: str | None = None
        self.at = 0

    def word(self, ahead: int = 0) -> Word:
        """A word from here on; an empty one behind the last."""
        place = self.at + ahead
        if 0 <= place < len(self.words):
            return self.words[place]
        end = self.words[-1].end_pos if self.words else 0
        return Word("", "", end, end)

    def run(self) -> None:
        """Go through all words."""
        while self.at < len(self.words):
            word = self.words[self.at]
            match word.value:
                case _ if word.type in _NAMES:
                    self._name()
                case "const" | "rate" | "prob":
                    self._constant()
                case "formula":
                    self._declare(Kind.FORMULA, 1)
                case "label":
                    self._declare(Kind.LABEL, 1)
                case "module":
                    self._begin_module()
                case "rewards" if self.language == "prism":
                    self.block = word.value
                    if self.word(1).type == "STRING":
                        self._declare(Kind.REWARDS, 1, to="endrewards")
                case "player":
                    self.block = word.value
                    self._declare(Kind.PLAYER, 1, to="endplayer")
                case "init" if self.block is None:
                    self.block = word.value
                case "system" | "observables":
                    self.block = word.value
                case _ if word.value in _LAST:
                    self.block = self.module = None
                case _:  # a sign, a number or a keyword
                    pass
            self.at += 1

    def _constant(self) -> None:
        typed = self.word(1).type in ("INT", "DOUBLE", "BOOL")
        self._declare(Kind.CONSTANT, 2 if typed else 1)

    def _begin_module(self) -> None:
        self.block, self.module = "module", self.word(1).value
        is_copy = self.word(2).value == "="
        base = self.word(3).value if is_copy else None
        self._declare(Kind.MODULE, 1, to="endmodule", copy_of=base)
        if base is None:
            return
        self.at += 2
        self._add(self.word(), (Kind.MODULE,))
        for old, new in self._renamings():
            copied = next(
                (
                    s
                    for s in self.symbols
                    if s.name == old.value and (s.within == base or s.kind is Kind.ACTION)
                ),
                None,
            )
            self._add(old, _RENAMED)
            known = any(s.name == new.value for s in self.symbols)
            if copied is not None and (
                copied.kind is Kind.VARIABLE or (copied.kind is Kind.ACTION and not known)
            ):
                symbol = Symbol(
                    copied.kind,
                    new.value,
                    *(new.start_pos, new.end_pos, old.start_pos, new.end_pos),
                    within=self.module,
                    copy_of=old.value,
                )
                self.symbols.append(symbol)
                if symbol.kind is Kind.ACTION:
                    self.actions.add(symbol.name)
            self._add(new, _RENAMED)

    def _renamings(self) -> Iterator[tuple[Word, Word]]:
        """The pairs `old=new` of a renamed module; the walk goes on behind them."""
        while self.word(1).value not in ("", "endmodule"):
            self.at += 1
            if self.word(1).value == "=" and self.word(2).type == "NAME":
                yield self.word(), self.word(2)
                self.at += 2

    def _declare(self, kind: Kind, ahead: int, to: str = ";", copy_of: str | None = None) -> None:
        """Note the declaration whose name is some words ahead."""
        first, name = self.word().start_pos, self.word(ahead)
        if name.type not in ("NAME", "STRING"):
            return
        self.at += ahead
        plain = name.value.strip('" \t')
        self.symbols.append(
            Symbol(kind, plain, *_inner(name), first, self._end(to), self.module, copy_of)
        )
        self._add(name, (kind,))

    def _end(self, to: str) -> int:
        """Where a declaration ends: behind the next such word, or before the next block."""
        last = self.word().end_pos
        for place in range(self.at, len(self.words)):
            word = self.words[place]
            if word.value == to:
                return word.end_pos
            stops = _STATEMENTS if to == ";" else ("module",)
            if place > self.at and word.value in stops:
                break
            last = word.end_pos
        return last

    def _name(self) -> None:
        """Note a name that is used, or a declaration that begins with its name."""
        word = self.word()
        if word.type == "STRING":
            self._quoted(word)
            return
        before, after = self.word(-1).value, self.word(1).value
        in_actions = self.block in ("module", "rewards") and before == "[" and after == "]"
        markovian = self.block == "module" and before == "<" and after == ">"
        if in_actions or markovian:
            if self.block == "module" and word.value not in self.actions:
                place = word.start_pos, word.end_pos
                self.actions.add(word.value)
                self.symbols.append(Symbol(Kind.ACTION, word.value, *place, *place, self.module))
            self._add(word, (Kind.ACTION,))
        elif after == ":" and self.language == "prism" and before in (";", "global", self.module):
            if self.block in ("module", None):
                self._declare(Kind.VARIABLE, 0)
        elif self.block == "system":
            self._add(word, (Kind.MODULE, Kind.ACTION))
        elif self.block == "player":
            self._add(word, (Kind.ACTION if before == "[" else Kind.MODULE,))
        elif word.type == "NAME":
            self._add(word, _VALUES)

    def _quoted(self, word: Word) -> None:
        """Note a name in quotes: a property that begins with its name, or a label or structure."""
        if self.language == "properties" and self.word(1).value == ":":
            self._declare(Kind.PROPERTY, 0)
            return
        in_braces = self.word(-1).value == "{" and self.word(1).value == "}"
        kinds = (Kind.REWARDS, Kind.LABEL, Kind.PROPERTY)
        self._add(word, kinds if in_braces else (*kinds[1:], kinds[0]))

    def _add(self, word: Word, kinds: tuple[Kind, ...]) -> None:
        self.occurrences.append(Occurrence(word.value.strip('" \t'), *_inner(word), kinds))


def _inner(word: Word) -> tuple[int, int]:
    """Where the name of a word stands, without quotes and the space within."""
    text = word.value
    if word.type != "STRING":
        return word.start_pos, word.end_pos
    inner = text[1:-1]
    start = word.start_pos + 1 + len(inner) - len(inner.lstrip())
    return start, start + len(inner.strip())
