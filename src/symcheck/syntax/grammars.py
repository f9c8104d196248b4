"""The two languages: their grammar files, and the Lark parsers that run them.

Lark analyses a grammar in about a fifth of a second. The result is kept in the user's cache
directory. Its name has a digest of the grammar and of the versions of Lark and Python, so that the
cache of another grammar or version is never read. If the directory cannot be written, every run
analyses the grammar.
"""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from typing import cast

import lark

from symcheck.syntax.ast import TYPE_WORDS
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.tree_builder import Builder, ModelBuilder, PropertiesBuilder
from symcheck.syntax.words import Lexer

__all__ = ["Language", "cache_directory", "grammar_text", "load"]

_BUILDERS: dict[str, type[Builder]] = {"prism": ModelBuilder, "properties": PropertiesBuilder}
_STARTS = {
    "prism": ["program", "expression", "misplaced"],
    "properties": ["properties", "state", "misplaced"],
}


_DECLARATIONS = (
    *("const", "formula", "global", "init", "label", "module", "observable", "observables"),
    *("player", "prob", "rate", "rewards", "system"),
)
"""The words that begin a declaration of a model."""


@dataclass(frozen=True)
class Language:
    """A parser, and the builder that it calls. A builder serves one text at a time."""

    parser: lark.Lark
    builder: Builder

    @cached_property
    def lexer(self) -> Lexer:
        """What finds the words of a text."""
        (ignored,) = self.parser.lexer_conf.ignore
        return Lexer(self.parser.terminals, ignored)

    @cached_property
    def spelling(self) -> dict[str, str]:
        """How the words with one spelling are written, by terminal."""
        return {
            terminal.name: terminal.pattern.value
            for terminal in self.parser.terminals
            if isinstance(terminal.pattern, lark.lexer.PatternStr)
        }

    def reserves(self, word: str) -> bool:
        """Whether a word is no name: a keyword, or a function if a parenthesis follows."""
        return self._reserved.match(f"{word}(") is not None

    @cached_property
    def _reserved(self) -> re.Pattern[str]:
        patterns = (
            f"(?:{terminal.pattern.to_regexp()})"
            for terminal in self.parser.terminals
            if terminal.name not in ("NAME", "FOREIGN")
        )
        return re.compile(rf"(?:{'|'.join(patterns)})(?=\(\Z)")


@cache
def load(name: str) -> Language:
    """The language 'prism' or 'properties'."""
    text = grammar_text(name)
    text += _operations() + _other_types(text)
    path = _cache_file(name, text)
    parser = None if path is None else _read(path)
    if parser is None:
        parser = lark.Lark(
            text,
            parser="lalr",
            lexer="basic",
            start=_STARTS[name],
            keep_all_tokens=True,
            transformer=_BUILDERS[name](),
        )
        if path is not None:
            _save(parser, path)
    return Language(parser, cast(Builder, parser.options.transformer))


def grammar_text(name: str) -> str:
    """The text of the grammar 'prism' or 'properties', as installed or as in the source tree."""
    packaged = Path(__file__).parents[1] / "grammar" / f"{name}.lark"
    if packaged.is_file():
        return packaged.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "grammar" / f"{name}.lark").read_text(encoding="utf-8")


def _operations() -> str:
    """The rule of the operators, and the terminals of operators and functions.

    The name of a function is a word of its own before a parenthesis only; elsewhere it is a name.
    `min` and `max` are words everywhere, because they are directions too.
    """
    functions = "|".join(f for f in Function if f.name not in ("MIN", "MAX"))
    return "\n".join(
        [
            f"?operator: {' | '.join(Operator.__members__)}",
            *(f'{operator.name}: "{operator}"' for operator in Operator),
            rf"FUNCTION.3: /(?:{functions})(?=\s*\()/",
        ]
    )


def _other_types(grammar: str) -> str:
    """The terminal of the types of models whose words are names elsewhere.

    Such a word is a type where a declaration follows, or nothing: neither follows a name.
    """
    words = "|".join(word for word in TYPE_WORDS if f': "{word}"' not in grammar)
    declarations = "|".join(_DECLARATIONS)
    space = r"(?:\s|\/\/[^\r\n]*(?![^\r\n]))"
    return rf"""
OTHER_TYPE.3: /(?:{words})(?={space}+(?:{declarations})(?![A-Za-z_0-9])|{space}*\Z)/
"""


def cache_directory() -> Path | None:
    """`$XDG_CACHE_HOME/symcheck`, or `~/.cache/symcheck`; None for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base, "symcheck") if os.path.isabs(base) else None


def _cache_file(name: str, text: str) -> Path | None:
    """The file that holds the parser of this grammar for these versions of Lark and Python."""
    directory = cache_directory()
    parts = (text, repr(_STARTS[name]), lark.__version__, sys.version)
    digest = sha256("\0".join(parts).encode()).hexdigest()[:32]
    return directory and directory / f"{name}-{digest}.lark"


def _read(path: Path) -> lark.Lark | None:
    """The saved parser, or None if it is missing or damaged."""
    try:
        with path.open("rb") as file:
            return lark.Lark.load(file)
    except Exception:  # a damaged pickle raises anything; the grammar is analysed anew
        return None


def _save(parser: lark.Lark, path: Path) -> None:
    """Save a parser. Other processes see the whole file or none, because the draft is renamed."""
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with draft.open("wb") as file:
            parser.save(file)
        draft.replace(path)
    except OSError:  # the next run analyses the grammar again
        pass
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
