"""What can stand at a place of a text: the parser tells which terminals, the names which names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from symcheck.lsp.help import FILTERS, HELP, OF_TERMINAL, Help
from symcheck.lsp.symbols import Kind, Symbol
from symcheck.lsp.words import comments
from symcheck.semantics.features import Feature, offers
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import TYPE_WORDS, WITHOUT_KEYWORD, ModelType
from symcheck.syntax.grammars import load
from symcheck.syntax.operators import Function
from symcheck.syntax.recovery import FOREIGN, Place, place_at_end
from symcheck.syntax.words import Word

__all__ = ["Item", "completions", "model_type", "place_in", "typed"]


class Item(NamedTuple):
    """A completion: what is written, what it is, more about it on one line, and an example."""

    word: str
    what: str
    detail: str
    example: str = ""


_STARTS = {"prism": "program", "properties": "properties"}
_BLOCKS = ("MODULE", "REWARDS", "PLAYER", "OBSERVABLES", "SYSTEM")
_ENDS = ("ENDMODULE", "ENDREWARDS", "ENDPLAYER", "ENDOBSERVABLES", "ENDSYSTEM", "ENDINIT")
_VALUES = (Kind.VARIABLE, Kind.CONSTANT, Kind.FORMULA)
_DECLARED = {
    "x : [0..1] init 0;": "a variable with a range, and its initial value",
    "x : bool init false;": "a variable that is true or false",
}
"""Declarations of variables."""


def completions(
    text: str,
    offset: int,
    language: str,
    words: Sequence[Word],
    symbols: Sequence[tuple[Symbol, str]],
    model: tuple[ModelType, BoundModel | None] | None,
) -> list[Item]:
    """What can stand at an offset, in place of the name that ends there; the likeliest first.

    Args:
        text: that of the document.
        offset: the place.
        language: 'prism' or 'properties'.
        words: those of the text.
        symbols: the declarations of the text and of its model, with their texts.
        model: the type of the model, and itself if it is without faults; None: it is unknown.
    """
    if any(start < offset <= end for start, end in comments(text)):
        return []
    place, in_quotes = place_in(text, offset, language, words)
    offer = _Offer(place, language, symbols, model, any(map(_is_type, words)))
    return list({i.word: i for i in (offer.quoted() if in_quotes else offer.all())}.values())


def typed(text: str, offset: int, words: Sequence[Word]) -> int:
    """Where the name begins of which a part is typed at an offset; else the offset."""
    found = [w.start_pos for w in words if w.start_pos < offset <= w.end_pos]
    start = found[0] if found else offset
    while start < offset and not text[start:offset].isidentifier():
        start += 1
    return start


def model_type(words: Sequence[Word]) -> ModelType:
    """The type that a model names, wherever it has faults."""
    return next((TYPE_WORDS[w.value] for w in words if _is_type(w)), WITHOUT_KEYWORD)


def _is_type(word: Word) -> bool:
    return word.value in TYPE_WORDS and word.type != "NAME"


def place_in(text: str, offset: int, language: str, words: Sequence[Word]) -> tuple[Place, bool]:
    """The place before the name that ends at an offset, and whether a quote is open there.

    The text is read from the last block of a model on, or from the last statement of properties.
    """
    ends, blocks = (_ENDS, _BLOCKS) if language == "prism" else (("SEMICOLON",), ())
    start = 0
    for word in reversed(words):
        if word.end_pos <= offset and word.type in (*ends, *blocks):
            start = word.end_pos if word.type in ends else word.start_pos
            break
    found = list(load(language).lexer.words(text[start:offset]))
    if found and found[-1].value.isidentifier() and start + found[-1].end_pos == offset:
        found.pop()
    in_quotes = bool(found) and found[-1].type == FOREIGN and found[-1].value == '"'
    if in_quotes:
        found.pop()
    before = text[start : start + found[-1].end_pos] if found else ""
    return place_at_end(load(language), _STARTS[language], before), in_quotes


class _Offer:
    """What is offered at one place."""

    def __init__(
        self,
        place: Place,
        language: str,
        symbols: Sequence[tuple[Symbol, str]],
        model: tuple[ModelType, BoundModel | None] | None,
        is_typed: bool,
    ) -> None:
        self.expected, self.open = place.expected, place.open
        self.language, self.symbols, self.model = language, symbols, model
        self.is_typed = is_typed
        self.ends = [word.type for word in self.open[-4:]]

    def _ends(self, *kinds: str) -> bool:
        """Whether these terminals are the last that are open."""
        return self.ends[-len(kinds) :] == list(kinds)

    def _named(self, kind: Kind, within: str | None = None) -> Iterator[Item]:
        """The names of a kind, in alphabetical order; those within a module first."""
        found = [(s, text) for s, text in self.symbols if s.kind is kind]
        for symbol, text in sorted(found, key=lambda f: (f[0].within != within, f[0].name)):
            yield Item(symbol.name, kind.value, text)

    # --------------------------------------------------------------------------------------- quotes

    def quoted(self) -> Iterator[Item]:
        """What can stand within quotes."""
        if "STRING" not in self.expected or not self._are_used():
            return
        if self._is_structure():
            yield from self._named(Kind.REWARDS)
            return
        yield from self._named(Kind.LABEL)
        yield Item("init", Kind.LABEL.value, "the initial states")
        yield Item("deadlock", Kind.LABEL.value, "the states without a transition in the text")
        if self.language == "properties":
            yield from self._named(Kind.PROPERTY)

    def _are_used(self) -> bool:
        """Whether a name in quotes is one that is declared, and not a new one."""
        return "INTEGER" in self.expected and self.ends[-1:] != ["REWARDS"]

    def _is_structure(self) -> bool:
        """Whether a reward structure is named here: behind a brace that follows no whole path."""
        return self._ends("LBRACE") and not self._ends("LSQB", "LBRACE")

    # ------------------------------------------------------------------------------------ elsewhere

    def all(self) -> Iterator[Item]:
        """What can stand outside of quotes."""
        if "DTMC" in self.expected:
            yield from self._declarations()
        elif {"ENDMODULE", "LSQB"} <= self.expected:
            yield from self._statements()
        elif "INTEGER" in self.expected:
            yield from self._expressions()
        elif "NAME" in self.expected:
            yield from self._names()
        else:
            yield from self._paths()
            yield from self._words()

    def _words(self) -> Iterator[Item]:
        """The words and signs with one spelling, in the order of the help."""
        spelling = load(self.language).spelling
        found = {spelling[kind] for kind in self.expected if kind in spelling}
        for word, text in HELP.items():
            if word not in found or word[0].isupper():
                continue
            if word in ("min", "max", "filter", "func") and "INTEGER" in self.expected:
                yield _of(f"{word}(", "function", text)
            else:
                yield _of(word, "keyword" if word.isalpha() else "sign", text)

    def _declarations(self) -> Iterator[Item]:
        """The words that begin a part of a model; its type while it has none."""
        words = [i for i in self._words() if i.word not in TYPE_WORDS]
        if not self.is_typed:
            yield from (_of(w, "keyword", HELP[w]) for w in TYPE_WORDS if w in HELP)
        yield from words

    def _statements(self) -> Iterator[Item]:
        """Declarations of variables, and commands."""
        kind = self.model[0] if self.model else WITHOUT_KEYWORD
        yield from self._commands()
        if kind.immediate_choices and "LT" in self.expected:
            yield Item("<> ", "command", "a command with a rate", HELP["ma"].example)
        if "NAME" in self.expected:
            for text, meaning in _DECLARED.items():
                yield Item(text, "declaration", meaning, text)
            if kind.has_clocks:
                yield _of("x : clock;", "declaration", HELP["clock"])
        yield from (
            item
            for item in self._words()
            if item.what == "keyword" and (item.word != "invariant" or kind.has_clocks)
        )

    def _commands(self) -> Iterator[Item]:
        """The beginnings of commands, with each action of the model, and of their rewards."""
        yield Item("[] ", "command", "a command that is not synchronised", HELP["->"].example)
        for action in self._named(Kind.ACTION):
            yield Item(f"[{action.word}] ", "command", "a command with this action")

    def _names(self) -> Iterator[Item]:
        """Names that are used where no expression can stand; nothing where a new one is made."""
        opened = [word.type for word in self.open]
        last = self.ends[-1] if self.ends else ""
        if self._ends("FILTER", "LPAR"):
            yield from (Item(name, "filter", text) for name, text in FILTERS.items())
        elif "QUANTILE" in opened:
            yield from self._named(Kind.CONSTANT)
        elif "SYSTEM" in opened:
            is_action = "LBRACE" in opened or any(w.value == "|[" for w in self.open)
            yield from self._named(Kind.ACTION if is_action else Kind.MODULE)
        elif "PLAYER" in opened:
            if last != "PLAYER":
                yield from self._named(Kind.ACTION if last == "LSQB" else Kind.MODULE)
        elif "OBSERVABLES" in opened:
            yield from self._named(Kind.VARIABLE)
        elif last in ("LSQB", "LT", "COMMA") and "EQ" not in opened:
            yield from self._named(Kind.ACTION)
        elif self._ends("MODULE", "NAME", "EQ"):
            yield from self._named(Kind.MODULE)
        elif "EQ" in opened and last in ("LSQB", "COMMA"):
            base = self.open[opened.index("EQ") + 1].value
            yield from (i for i, s in self._symbols(Kind.VARIABLE) if s.within == base)
            yield from self._named(Kind.ACTION)
        elif last == "LPAR":
            yield from self._updates()

    def _symbols(self, kind: Kind) -> Iterator[tuple[Item, Symbol]]:
        for symbol, text in self.symbols:
            if symbol.kind is kind:
                yield Item(symbol.name, kind.value, text), symbol

    @property
    def _module(self) -> str | None:
        """The module in which the place is."""
        names = (b.value for a, b in pairwise(self.open) if a.type == "MODULE")
        return next(names, None)

    def _updates(self) -> Iterator[Item]:
        """The variables that a command may change, with a prime."""
        for item, symbol in self._symbols(Kind.VARIABLE):
            if symbol.within in (None, self._module):
                yield Item(f"{item.word}'=", item.what, item.detail)

    def _expressions(self) -> Iterator[Item]:
        if self._ends("ARROW", "LPAR"):
            yield from self._updates()
        if "ENDREWARDS" in self.expected:
            yield from self._commands()
        in_properties = self.language == "properties"
        begins = "CONST" in self.expected
        if begins:
            yield from self._measures()
        yield from self._paths()
        if "STRING" in self.expected and self._are_used():
            yield from (i._replace(word=f'"{i.word}"') for i in self.quoted())
        for kind in _VALUES:
            yield from self._named(kind, self._module)
        if in_properties and not begins:
            yield from self._measures()
        words = list(self._words())
        yield from (i for i in words if i.what == "keyword")
        yield from (_of(f"{f}(", "function", HELP[f]) for f in Function)
        yield from (i for i in words if i.what != "keyword")

    def _paths(self) -> Iterator[Item]:
        """The operators of paths and the queries of rewards that can stand here."""
        if "C" in self.expected:
            yield from (_of(word, "query", HELP[word[0]]) for word in ("F", "C<=", "C", "I="))
            if self._has(Feature.LONG_RUN):
                yield _of("S", "query", HELP["S"])
        if "NEXT" in self.expected:
            yield from (_of(word, "path operator", HELP[word]) for word in "FGX")
        if "UNTIL" in self.expected:
            for word, text in (("U", HELP["U"]), ("W", HELP["W"]), ("R", OF_TERMINAL["RELEASE"])):
                yield _of(word, "path operator", text)
        if "GIVEN" in self.expected:
            yield _of("||", "path operator", OF_TERMINAL["GIVEN"])

    def _has(self, feature: Feature) -> bool:
        """Whether the model offers a feature; a faulty or unknown one offers all."""
        bound = self.model[1] if self.model else None
        return bound is None or offers(bound, feature)

    def _measures(self) -> Iterator[Item]:
        """The operators that a property of this model may begin with."""
        kind = self.model[0] if self.model else None
        chosen = kind is None or kind.has_choices
        directions = ["", "max", "min"] if kind is None else ["max", "min"] if chosen else [""]
        player = "<<1>> " if kind is not None and kind.players > 1 else ""
        structures = [f'{{"{item.word}"}}' for item in self._named(Kind.REWARDS)]
        for letter, feature in (
            ("P", Feature.REACHABILITY),
            ("R", Feature.REACH_REWARDS),
            ("S", Feature.LONG_RUN),
            ("T", Feature.REACH_REWARDS),
        ):
            if not self._has(feature):
                continue
            for structure in (*structures, "") if letter == "R" else ("",):
                for direction in directions:
                    word = f"{player}{letter}{structure}{direction}=? [ "
                    yield _of(word, "measure", HELP[letter + direction])
        if self._has(Feature.SOME_OR_ALL_PATHS):
            yield from (_of(f"{word} [ ", "measure", HELP[word]) for word in "AE")
        if chosen and self._has(Feature.MULTI_OBJECTIVE):
            yield from (_of(f"{word}(", "function", HELP[word]) for word in ("multi", "multilex"))
        if self._has(Feature.QUANTILES):
            yield _of("quantile(", "function", HELP["quantile"])


def _of(word: str, what: str, text: Help) -> Item:
    return Item(word, what, text.meaning, text.example)
