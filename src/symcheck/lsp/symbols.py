"""What the names of a text stand for: declarations and uses, found by the words around them.

They are found in a text with faults too, where no syntax tree is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum

from symcheck.lsp.words import Word, words

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
_STATEMENTS = ("const", "formula", "label", "module", "rewards", "endmodule", "endrewards")
"""Words before which a declaration without its semicolon ends."""


@dataclass(frozen=True)
class Names:
    """The declarations of a text, and all names in it."""

    symbols: tuple[Symbol, ...]
    occurrences: tuple[Occurrence, ...]

    def declared(self, name: str, kinds: Sequence[Kind]) -> Symbol | None:
        """The declaration of a name as the first of these kinds that it has."""
        found = {s.kind: s for s in reversed(self.symbols) if s.name == name}
        return next((found[kind] for kind in kinds if kind in found), None)

    def at(self, offset: int) -> Occurrence | None:
        """The name that stands at an offset, or ends there."""
        return next((o for o in self.occurrences if o.start <= offset <= o.end), None)


def names_of(text: str, language: str) -> Names:
    """The names of a model ('prism') or of a properties file ('properties').

    Examples:
        >>> found = names_of("dtmc const int N = 3; module m x : [0..N]; endmodule", "prism")
        >>> [(symbol.kind.value, symbol.name) for symbol in found.symbols]
        [('constant', 'N'), ('module', 'm'), ('variable', 'x')]
    """
    reading = _Reading(words(text, language), language)
    reading.run()
    return Names(tuple(reading.symbols), tuple(reading.occurrences))


class _Reading:
    """One walk through the words; `block` is the block that is open."""

    def __init__(self, found: Sequence[Word], language: str) -> None:
        self.words, self.language = found, language
        self.symbols: list[Symbol] = []
        self.occurrences: list[Occurrence] = []
        self.block: str | None = None
        self.module: str | None = None
        self.at = 0

    def word(self, ahead: int = 0) -> Word:
        """A word from here on; an empty one behind the last."""
        place = self.at + ahead
        if 0 <= place < len(self.words):
            return self.words[place]
        end = self.words[-1].end if self.words else 0
        return Word("", "", end, end)

    def run(self) -> None:
        """Go through all words."""
        while self.at < len(self.words):
            word = self.word()
            match word.text:
                case "const" | "rate" | "prob":
                    self._constant()
                case "formula":
                    self._declare(Kind.FORMULA, 1)
                case "label":
                    self._declare(Kind.LABEL, 1)
                case "module":
                    self._begin_module()
                case "rewards" if self.language == "prism":
                    self.block = word.text
                    if self.word(1).kind == "STRING":
                        self._declare(Kind.REWARDS, 1, to="endrewards")
                case "player":
                    self.block = word.text
                    self._declare(Kind.PLAYER, 1, to="endplayer")
                case "init" if self.block is None:
                    self.block = word.text
                case "system" | "observables":
                    self.block = word.text
                case _ if word.text in _ENDS.values():
                    self.block = self.module = None
                case _:
                    self._name()
            self.at += 1

    def _constant(self) -> None:
        typed = self.word(1).kind in ("INT", "DOUBLE", "BOOL")
        self._declare(Kind.CONSTANT, 2 if typed else 1)

    def _begin_module(self) -> None:
        self.block, self.module = "module", self.word(1).text
        is_copy = self.word(2).text == "="
        base = self.word(3).text if is_copy else None
        self._declare(Kind.MODULE, 1, to="endmodule", copy_of=base)
        if base is None:
            return
        self.at += 2
        self._add(self.word(), (Kind.MODULE,))
        for old, new in self._renamings():
            copied = next(
                (s for s in self.symbols if s.name == old.text and s.within == base), None
            )
            self._add(old, _RENAMED)
            if copied is not None and copied.kind is Kind.VARIABLE:
                symbol = Symbol(
                    Kind.VARIABLE,
                    new.text,
                    *(new.start, new.end, old.start, new.end),
                    within=self.module,
                    copy_of=old.text,
                )
                self.symbols.append(symbol)
            self._add(new, _RENAMED)

    def _renamings(self) -> Iterator[tuple[Word, Word]]:
        """The pairs `old=new` of a renamed module; the walk goes on behind them."""
        while self.word(1).text not in ("", "endmodule"):
            self.at += 1
            if self.word(1).text == "=" and self.word(2).kind == "NAME":
                yield self.word(), self.word(2)
                self.at += 2

    def _declare(self, kind: Kind, ahead: int, to: str = ";", copy_of: str | None = None) -> None:
        """Note the declaration whose name is some words ahead."""
        first, name = self.word().start, self.word(ahead)
        if name.kind not in ("NAME", "STRING"):
            return
        self.at += ahead
        plain = name.text.strip('" \t')
        self.symbols.append(
            Symbol(kind, plain, *_inner(name), first, self._end(to), self.module, copy_of)
        )
        self._add(name, (kind,))

    def _end(self, to: str) -> int:
        """Where a declaration ends: behind the next such word, or before the next block."""
        last = self.word().end
        for place in range(self.at, len(self.words)):
            word = self.words[place]
            if word.text == to:
                return word.end
            stops = _STATEMENTS if to == ";" else ("module",)
            if place > self.at and word.text in stops:
                break
            last = word.end
        return last

    def _name(self) -> None:
        """Note a name that is used, or a declaration that begins with its name."""
        word = self.word()
        if word.kind == "STRING":
            self._quoted(word)
        if word.kind not in ("NAME", "FUNCTION"):
            return
        before, after = self.word(-1).text, self.word(1).text
        in_actions = self.block in ("module", "rewards") and before == "[" and after == "]"
        markovian = self.block == "module" and before == "<" and after == ">"
        if in_actions or markovian:
            if self.block == "module" and not any(
                s.kind is Kind.ACTION and s.name == word.text for s in self.symbols
            ):
                place = word.start, word.end
                self.symbols.append(Symbol(Kind.ACTION, word.text, *place, *place, self.module))
            self._add(word, (Kind.ACTION,))
        elif after == ":" and self.language == "prism" and before in (";", "global", self.module):
            if self.block in ("module", None):
                self._declare(Kind.VARIABLE, 0)
        elif self.block == "system":
            self._add(word, (Kind.MODULE, Kind.ACTION))
        elif self.block == "player":
            self._add(word, (Kind.ACTION if before == "[" else Kind.MODULE,))
        elif word.kind == "NAME":
            self._add(word, _VALUES)

    def _quoted(self, word: Word) -> None:
        """Note a name in quotes: a property that begins with its name, or a label or structure."""
        if self.language == "properties" and self.word(1).text == ":":
            self._declare(Kind.PROPERTY, 0)
            return
        in_braces = self.word(-1).text == "{" and self.word(1).text == "}"
        kinds = (Kind.REWARDS, Kind.LABEL, Kind.PROPERTY)
        self._add(word, kinds if in_braces else (*kinds[1:], kinds[0]))

    def _add(self, word: Word, kinds: tuple[Kind, ...]) -> None:
        self.occurrences.append(Occurrence(word.text.strip('" \t'), *_inner(word), kinds))


def _inner(word: Word) -> tuple[int, int]:
    """Where the name of a word stands, without quotes and the space within."""
    text = word.text
    if word.kind != "STRING":
        return word.start, word.end
    inner = text[1:-1]
    start = word.start + 1 + len(inner) - len(inner.lstrip())
    return start, start + len(inner.strip())
