"""The two languages: their grammar files, and the Lark parsers that run them.

Lark analyses a grammar in about a fifth of a second. The result is kept in the user's cache
directory, in a form that is read faster than Lark's own. Its name has a digest of the grammar and
of the versions of Lark and Python, so that the cache of another grammar or version is never read.
If the directory cannot be written, every run analyses the grammar.
"""

from __future__ import annotations

import os
import pickle
import re
import sys
from contextlib import suppress
from functools import cache, cached_property
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import lark
from lark.grammar import Rule
from lark.lexer import TerminalDef
from lark.parsers.lalr_analysis import IntParseTable, Reduce, Shift
from lark.parsers.lalr_parser import LALR_Parser
from lark.parsers.lalr_parser import _Parser as TableParser
from lark.utils import SerializeMemoizer

from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.tree_builder import Builder, ModelBuilder, PropertiesBuilder

__all__ = ["Language", "cache_directory", "grammar_text", "load", "load_interactive"]

_FORMAT = "rows of numbers"
"""Of saved parsers; another one has another name."""
_BUILDERS: dict[str, type[Builder]] = {"prism": ModelBuilder, "properties": PropertiesBuilder}
_STARTS = {
    "prism": ["program", "expression", "misplaced"],
    "properties": ["properties", "state", "misplaced"],
}


@dataclass(frozen=True)
class Language:
    """A parser, and the builder that it calls. A builder serves one text at a time.

    is_compiled: whether lark-cython runs the parser.
    """

    parser: lark.Lark
    builder: Builder
    is_compiled: bool

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


def load(name: str) -> Language:
    """The language 'prism' or 'properties'.

    Its parser uses the compiled parts of Lark if lark-cython is installed.
    """
    return _load(name, find_spec("lark_cython") is not None)


def load_interactive(name: str) -> Language:
    """The same language without lark-cython, which has no interactive parser."""
    return _load(name, False)


class _Parser(LALR_Parser):
    """A parser whose table is saved as numbers, which are read ten times as fast as Lark's rows.

    A number is the next state of a shift, or ~n for the reduction by the nth rule.
    """

    def serialize(self, memo: SerializeMemoizer | None = None) -> dict[str, Any]:
        """The table as numbers."""
        assert memo is not None
        table = self._parse_table
        rows = {
            state: {
                token: argument if action is Shift else ~memo.memoized.get(argument)
                for token, (action, argument) in row.items()
            }
            for state, row in table.states.items()
        }
        return {"rows": rows, "ends": (table.start_states, table.end_states)}

    @classmethod
    def deserialize(cls, data: Any, memo: Any, callbacks: Any = None, debug: bool = False) -> Any:
        """The parser of saved numbers."""
        actions: dict[int, tuple[Any, Any]] = {state: (Shift, state) for state in data["rows"]}
        actions |= {~number: (Reduce, rule) for number, rule in memo.items()}
        states = {
            state: dict(zip(row, map(actions.__getitem__, row.values()), strict=True))
            for state, row in data["rows"].items()
        }
        parser: Any = cls.__new__(cls)
        parser._parse_table = cast(Any, IntParseTable)(states, *data["ends"])
        parser.parser = TableParser(parser._parse_table, callbacks, debug)
        return parser


@cache
def _load(name: str, compiled: bool) -> Language:
    text = grammar_text(name)
    path = _cache_file(name, text, compiled)
    parser = None if path is None else _read(path)
    if parser is None:
        parser = lark.Lark(
            text,
            parser="lalr",
            lexer="basic",
            start=_STARTS[name],
            keep_all_tokens=True,
            transformer=_BUILDERS[name](),
            _plugins=_plugins() if compiled else {"LALR_Parser": _Parser},
        )
        if path is not None:
            _save(parser, path)
    return Language(parser, cast(Builder, parser.options.transformer), compiled)


def grammar_text(name: str) -> str:
    """The text of the grammar 'prism' or 'properties', as installed or as in the source tree."""
    packaged = Path(__file__).parents[1] / "grammar" / f"{name}.lark"
    if packaged.is_file():
        return packaged.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "grammar" / f"{name}.lark").read_text(encoding="utf-8")


def _plugins() -> dict[str, Any]:
    """Compiled parts of Lark, from the package lark-cython."""
    import lark_cython

    return dict(lark_cython.plugins)


def cache_directory() -> Path | None:
    """`$XDG_CACHE_HOME/symcheck`, or `~/.cache/symcheck`; None for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base, "symcheck") if os.path.isabs(base) else None


def _cache_file(name: str, text: str, compiled: bool) -> Path | None:
    """The file that holds the parser of this grammar for these versions of Lark and Python."""
    directory = cache_directory()
    parts = (_FORMAT, text, repr(_STARTS[name]), lark.__version__, sys.version, repr(compiled))
    digest = sha256("\0".join(parts).encode()).hexdigest()[:32]
    return directory and directory / f"{name}-{digest}.lark"


def _read(path: Path) -> lark.Lark | None:
    """The saved parser, or None if it is missing or damaged."""
    try:
        with path.open("rb") as file:
            saved: dict[str, Any] = pickle.load(file)
        for item in saved["memo"].values():
            if isinstance(item, Rule):
                cast(Any, item)._deserialize()  # its hash value differs in each process
        return cast(lark.Lark | None, cast(Any, lark.Lark)._load_from_dict(**saved))
    except Exception:  # a damaged pickle raises anything; the grammar is analysed anew
        return None


def _save(parser: lark.Lark, path: Path) -> None:
    """Save a parser. Other processes see the whole file or none, because the draft is renamed."""
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with draft.open("wb") as file:
            memo = SerializeMemoizer([TerminalDef, Rule])
            data = parser.serialize(memo)
            pickle.dump({"data": data, "memo": memo.memoized.reversed()}, file)
        draft.replace(path)
    except OSError:  # the next run analyses the grammar again
        pass
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
