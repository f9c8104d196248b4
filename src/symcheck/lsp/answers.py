"""What an editor shows of a text: faults, help at a name, completions, an outline, and edits.

Places are offsets in the text; `server` converts them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from symcheck.errors import Diagnostic, InputError, Source, SymcheckError
from symcheck.lsp.completion import Item, completions, model_type, place_in, typed
from symcheck.lsp.fixes import quick_fixes
from symcheck.lsp.help import FILTERS, HELP, OF_TERMINAL
from symcheck.lsp.pieces import Pieces, parse_pieces
from symcheck.lsp.symbols import QUOTED, Kind, Names, Occurrence, Symbol, names_of
from symcheck.lsp.words import comments, words
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.binding.bind_model import undefined_constants
from symcheck.semantics.binding.bind_properties import bind_properties
from symcheck.semantics.binding.kept_modules import KeptModules
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.model import BoundModel
from symcheck.semantics.model_warnings import model_warnings
from symcheck.syntax.ast import TYPE_WORDS
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.grammars import load
from symcheck.syntax.properties_in_part import (
    PropertiesInput,
    UnparsedProperty,
    parse_properties_in_part,
)
from symcheck.syntax.words import Word

__all__ = ["COLOURS", "MODELS", "Document", "Edit", "Item", "Place", "formatted", "quick_fixes"]

MODELS = (".pm", ".nm", ".sm", ".prism", ".mm", ".ma", ".pta", ".smg", ".pomdp")
"""The endings of the names of models; other files that a client sends hold properties."""


class Place(NamedTuple):
    """A piece of the text of a document."""

    document: Document
    start: int
    end: int


class Edit(NamedTuple):
    """New text for a piece of a document."""

    place: Place
    text: str


@dataclass(frozen=True, eq=False)
class Document:
    """One version of a text in an editor, and the model that it belongs to.

    Attributes:
        uri: its name in the editor.
        text: its characters.
        language: 'prism', or 'properties'.
        model: the document of the model, of properties; None if none is known.
        kept: the modules of the version before.
    """

    uri: str
    text: str
    language: str
    model: Document | None = None
    kept: KeptModules = field(default_factory=KeptModules)

    @property
    def name(self) -> str:
        """The last part of the uri."""
        return self.uri.rpartition("/")[2]

    @cached_property
    def source(self) -> Source:
        """The text, which tells lines and columns."""
        return Source(self.name, self.text)

    @cached_property
    def names(self) -> Names:
        """Declarations and uses."""
        return names_of(self.words, self.language)

    @cached_property
    def words(self) -> list[Word]:
        """The words."""
        return words(self.text, self.language)

    # ------------------------------------------------------------------------------------- analysis

    @cached_property
    def _analysis(
        self,
    ) -> tuple[Pieces | PropertiesInput | None, BoundModel | None, list[Diagnostic]]:
        """The tree and the bound model, as far as there are any, and the faults."""
        try:
            if self.language == "prism":
                pieces = parse_pieces(self.text, self.name)
                bound, faults = self._bound(pieces.program)
                return pieces, bound, [pieces.placed(d) for d in faults]
            given = parse_properties_in_part(self.text, self.name)
            faults = [*given.diagnostics, *self._faults_of_properties(given.parsed)]
            return given, None, [*dict.fromkeys(faults)]  # who uses what is faulty has its fault
        except InputError as error:
            return None, None, list(error.diagnostics)
        except SymcheckError as error:
            return None, None, [Diagnostic(str(error))]

    def _bound(self, program: Program) -> tuple[BoundModel | None, list[Diagnostic]]:
        """The model with the least values that open constants may have, for all that needs none."""
        given = {
            c.name: "true" if c.type.value == "bool" else "1" for c in undefined_constants(program)
        }
        try:
            bound = bind(program, given, kept=self.kept)
        except InputError as error:
            return None, list(error.diagnostics)
        except SymcheckError as error:
            return None, [Diagnostic(str(error))]
        if given:
            return bound, []
        return bound, [Diagnostic(text, severity="warning") for text in bound.warnings]

    def _faults_of_properties(self, file: PropertiesFile) -> list[Diagnostic]:
        if self.model is None or self.model.bound is None:
            return []
        try:
            found = bind_properties(file, self.model.bound, {}).properties
            faults = [d for p in found if p.fault is not None for d in p.fault.diagnostics]
        except InputError as error:
            faults = list(error.diagnostics)
        except SymcheckError as error:
            faults = [Diagnostic(str(error))]
        return [d for d in faults if d.code != "undefined-constant"]

    @property
    def bound(self) -> BoundModel | None:
        """The bound model of a model without faults; open constants are 1 or true."""
        return self._analysis[1]

    @property
    def diagnostics(self) -> list[Diagnostic]:
        """The faults that are found without exploring states."""
        return self._analysis[2]

    @cached_property
    def warnings(self) -> list[Diagnostic]:
        """What a beginner may not have meant. Finding it takes as long as reading the text."""
        pieces, bound = self._analysis[:2]
        if not isinstance(pieces, Pieces) or bound is None or bound.given:
            return []
        return [pieces.placed(d) for d in model_warnings(bound, Options())]

    @property
    def program(self) -> Program | PropertiesFile | None:
        """The syntax tree, without properties that are faulty; None of a faulty model."""
        match self._analysis[0]:
            case Pieces(program=program):
                return program
            case PropertiesInput() as given:
                return given.parsed
            case None:
                return None

    @property
    def unparsed(self) -> list[UnparsedProperty]:
        """The properties that do not follow the grammar."""
        given = self._analysis[0]
        return [*given.unparsed.values()] if isinstance(given, PropertiesInput) else []

    # ---------------------------------------------------------------------------------------- names

    @property
    def _family(self) -> tuple[Document, ...]:
        """The document, and that of its model."""
        return (self,) if self.model is None else (self, self.model)

    def declaration(self, offset: int) -> tuple[Place, Symbol] | None:
        """Where the name at an offset is declared, in this document or in that of its model."""
        found = self.names.at(offset)
        if found is None:
            return None
        for document in self._family:
            symbol = document.names.declared(found.name, found.kinds)
            if symbol is not None:
                return Place(document, symbol.start, symbol.end), symbol
        return None

    def uses(self, offset: int, others: Sequence[Document] = ()) -> list[Place]:
        """All places of what the name at an offset stands for, its declaration among them.

        Args:
            offset: a place in this document.
            others: further documents, such as properties of this model.
        """
        found = self.declaration(offset)
        if found is None:
            return []
        place, symbol = found
        documents = [
            d for d in dict.fromkeys((place.document, self, *others)) if place.document in d._family
        ]
        return [
            Place(document, o.start, o.end)
            for document in documents
            for o in document.names.occurrences
            if o.name == symbol.name and document._means(o, symbol)
        ]

    def _means(self, occurrence: Occurrence, symbol: Symbol) -> bool:
        """Whether a name stands for what a symbol declares."""
        for document in self._family:
            declared = document.names.declared(occurrence.name, occurrence.kinds)
            if declared is not None:
                return declared.kind is symbol.kind
        return False

    def related(self, others: Sequence[Document]) -> list[Document]:
        """The document itself, its model, and those of the others that hold properties of it."""
        of_it = [d for d in others if d.model is not None and d.model.uri == self.uri]
        return [*self._family, *(d for d in of_it if d.uri != self.uri)]

    def renamed(self, offset: int, name: str, others: Sequence[Document] = ()) -> list[Edit]:
        """The edits that rename what stands at an offset.

        Raises ValueError: it is no name, or the new one is none, or taken.
        """
        found = self.declaration(offset)
        if found is None:
            raise ValueError("there is no name that could be changed")
        place, symbol = found
        if not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
            raise ValueError(f"'{name}' is no name: letters, digits and _ are, not a digit first")
        if symbol.kind not in QUOTED:
            if load("prism").reserves(name) or load("properties").reserves(name):
                raise ValueError(f"'{name}' is a word of the language")
        kinds = (symbol.kind, *_LIKE.get(symbol.kind, ()))
        for document in place.document.related(others):
            taken = document.names.declared(name, kinds)
            if taken is not None and taken.name != symbol.name:
                raise ValueError(f"'{name}' is already a {taken.kind.value} in {document.name}")
        return [Edit(use, name) for use in self.uses(offset, others)]

    # ----------------------------------------------------------------------------------------- help

    def hover(self, offset: int, states: int | None = None) -> tuple[str, Place] | None:
        """What stands at an offset, in Markdown, and the piece of the text that this is about.

        states: the number of reachable states, if it is known.
        """
        found, declared = self.names.at(offset), self.declaration(offset)
        if found is not None and declared is not None:
            place, symbol = declared
            text = place.document.about(symbol)
            return text, Place(self, found.start, found.end)
        word = next((w for w in self.words if w.start_pos <= offset < w.end_pos), None)
        if word is None:
            return None
        shown = self._help(word)
        if word.value in TYPE_WORDS and states is not None:
            shown = f"{states:,} reachable states\n\n{shown}"
        return None if shown is None else (shown, Place(self, word.start_pos, word.end_pos))

    def _help(self, word: Word) -> str | None:
        """What a word or sign means where it stands."""
        at = self.words.index(word)
        if [w.value for w in self.words[max(at - 2, 0) : at]] == ["filter", "("]:
            meant = FILTERS.get(word.value)
            return meant and f"{meant}: `filter({word.value}, …)`"
        found = HELP.get(word.value)
        if word.type in OF_TERMINAL and (found is None or self._follows_operand(word)):
            found = OF_TERMINAL[word.type]
        return None if found is None else found.markdown

    def _follows_operand(self, word: Word) -> bool:
        """Whether `U` could stand in the place of a word."""
        place, _ = place_in(self.text, word.start_pos, self.language, self.words)
        return "UNTIL" in place.expected

    def about(self, symbol: Symbol) -> str:
        """A declaration, and what is known of it, in Markdown."""
        text = self.text[symbol.first : symbol.last]
        if symbol.kind in (Kind.MODULE, Kind.REWARDS, Kind.PLAYER):
            text = text.splitlines()[0]
        lines = [f"```prism\n{text}\n```"]
        bound = self.bound
        match symbol.kind:
            case Kind.VARIABLE:
                where = (
                    f"variable of module {symbol.within}" if symbol.within else "global variable"
                )
                copied = f", a copy of {symbol.copy_of}" if symbol.copy_of else ""
                lines.append(where + copied + self._range(symbol, bound))
            case Kind.CONSTANT if bound is not None:
                value = bound.constants.get(symbol.name)
                is_open = bound.given.get(symbol.name) is not None
                lines.append(
                    "without a value"
                    if is_open
                    else f"= {format_value(value)}"
                    if value is not None
                    else ""
                )
            case Kind.MODULE if symbol.copy_of:
                lines.append(f"a copy of module {symbol.copy_of}")
            case Kind.ACTION:
                modules = dict.fromkeys(self._modules_with(symbol.name))
                lines.append(f"action of {', '.join(modules)}")
            case _:
                lines.append(symbol.kind.value)
        return "\n\n".join(line for line in lines if line)

    def _range(self, symbol: Symbol, bound: BoundModel | None) -> str:
        found = [v for v in bound.variables if v.name == symbol.name] if bound else []
        if not found or found[0].low is None or bound is None or bound.given:
            return ""
        variable = found[0]
        return f", {variable.type.value}" + (
            f" from {variable.low} to {variable.high}" if variable.type.value == "int" else ""
        )

    def _modules_with(self, action: str) -> Iterator[str]:
        """The modules that have an action; a copy has those of its original, renamed."""
        actions: dict[str, set[str]] = {}
        for module in (s for s in self.names.symbols if s.kind is Kind.MODULE):
            found = [
                o.name
                for o in self.names.occurrences
                if Kind.ACTION in o.kinds and module.first <= o.start < module.last
            ]
            if module.copy_of is None:
                actions[module.name] = set(found)
            else:
                new = dict(zip(found[::2], found[1::2], strict=False))
                actions[module.name] = {new.get(a, a) for a in actions.get(module.copy_of, ())}
            if action in actions[module.name]:
                yield module.name

    # ---------------------------------------------------------------------------------- completions

    def completions(self, offset: int) -> list[Item]:
        """What can stand at an offset, in place of the name that ends there; the likeliest first.

        It is written in place of the text from `typed(offset)` to the offset.
        """
        symbols = [
            (s, " ".join(d.text[s.first : s.last].split())[:80])
            for d in self._family
            for s in d.names.symbols
        ]
        model = self if self.language == "prism" else self.model
        known = None
        if model is not None:  # what more is known of it than its type is asked for properties only
            known = model_type(model.words), None if model is self else model.bound
        return completions(self.text, offset, self.language, self.words, symbols, known)

    def typed(self, offset: int) -> int:
        """Where the name begins that ends at an offset, or the offset."""
        return typed(self.text, offset, self.words)

    # -------------------------------------------------------------------------------------- outline

    def outline(self) -> list[tuple[Symbol, list[Symbol]]]:
        """The declarations and properties in the order of the text; those of a module within it.

        The name of a property without one is its text.
        """
        inner: dict[str, list[Symbol]] = {}
        outer: list[Symbol] = []
        named = {symbol.first for symbol in self.names.symbols}
        unnamed = [
            Symbol(Kind.PROPERTY, " ".join(text.split()), start, end, start, end)
            for start, end, text in self.properties()
            if start not in named
        ]
        for symbol in sorted([*self.names.symbols, *unnamed], key=lambda s: s.first):
            if symbol.kind is Kind.ACTION:
                continue
            if symbol.within is not None and symbol.kind is not Kind.MODULE:
                inner.setdefault(symbol.within, []).append(symbol)
            else:
                outer.append(symbol)
        return [(s, inner.get(s.name, []) if s.kind is Kind.MODULE else []) for s in outer]

    def colours(self) -> list[tuple[int, int, str]]:
        """Where which kind of word stands: start, end and a type of semantic tokens, in order."""
        kinds = {o.start: o for o in self.names.occurrences}
        found = [(start, end, "comment") for start, end in comments(self.text)]
        for word in self.words:
            inner = kinds.get(word.start_pos) or kinds.get(
                word.start_pos + 1 if word.type == "STRING" else -1
            )
            if inner is not None:
                found.append((word.start_pos, word.end_pos, self._colour(inner)))
            elif word.type in ("INTEGER", "REAL"):
                found.append((word.start_pos, word.end_pos, "number"))
            elif word.type == "FUNCTION" or word.value in ("min", "max"):
                found.append((word.start_pos, word.end_pos, "function"))
            elif word.value[:1].isalpha():
                found.append((word.start_pos, word.end_pos, "keyword"))
        return sorted(found)

    def _colour(self, occurrence: Occurrence) -> str:
        for document in self._family:
            symbol = document.names.declared(occurrence.name, occurrence.kinds)
            if symbol is not None:
                return COLOURS[symbol.kind]
        return COLOURS[occurrence.kinds[0]]

    def properties(self) -> list[tuple[int, int, str]]:
        """Where the properties of a file stand that follow the grammar, and their texts."""
        if not isinstance(self.program, PropertiesFile):
            return []
        spans = [p.span for p in self.program.properties]
        return [(span.start, span.end, span.text) for span in spans]


_VALUES = (Kind.VARIABLE, Kind.CONSTANT, Kind.FORMULA)
_LIKE: Mapping[Kind, tuple[Kind, ...]] = dict.fromkeys(_VALUES, _VALUES)
"""The kinds that share their names."""

COLOURS: Mapping[Kind, str] = {
    Kind.VARIABLE: "variable",
    Kind.CONSTANT: "parameter",
    Kind.FORMULA: "macro",
    Kind.LABEL: "string",
    Kind.MODULE: "class",
    Kind.ACTION: "event",
    Kind.REWARDS: "string",
    Kind.PROPERTY: "string",
    Kind.PLAYER: "class",
}
"""The type of semantic tokens for each kind."""


def formatted(text: str) -> str:
    r"""A model or properties with even indentation; lines, comments and words stay.

    The lines of a block are indented by two spaces, and the further lines of a statement by two
    more, unless they were indented further.

    Examples:
        >>> print(formatted("module m\nx : bool;\n[] x ->\n(x'=false);\nendmodule"), end="")
        module m
          x : bool;
          [] x ->
            (x'=false);
        endmodule
    """
    result: list[str] = []
    depth, goes_on = 0, False
    for line in text.splitlines():
        code = line.partition("//")[0].strip()
        first = code.split(" ", 1)[0]
        if first.startswith("end") and depth:
            depth, goes_on = depth - 1, False
        indent = "  " * (depth + (goes_on and not code.startswith("//")))
        own = line[: len(line) - len(line.lstrip())].expandtabs(4)
        if goes_on and len(own) > len(indent):
            indent = own
        result.append((indent + line.strip()).rstrip())
        opens = first in _BLOCKS and f"end{first}" not in code
        depth += opens
        if code:
            ended = code.endswith((";", "endmodule", "endrewards")) or opens or first in TYPE_WORDS
            goes_on = not ended and not first.startswith("end")
    while len(result) > 1 and not result[-1]:
        result.pop()
    return "\n".join(result) + "\n"


_BLOCKS = ("module", "rewards", "init", "system", "player", "observables", "invariant")
