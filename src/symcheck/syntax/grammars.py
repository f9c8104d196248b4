"""The two languages: their grammar files, and the parsers that run them.

Lark analyses a grammar in about a fifth of a second. The tables that it finds are kept in the
user's cache directory. The name of the file has a digest of the grammar and of the versions of Lark
and Python, so that the cache of another grammar or version is never read, and Lark is imported only
where a grammar is analysed. If the directory cannot be written, every run analyses the grammar.
"""

from __future__ import annotations

import marshal
import os
import re
import sys
from contextlib import suppress
from functools import cache, cached_property
from importlib.util import find_spec, source_hash
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symcheck.syntax.ast import TYPE_WORDS
from symcheck.syntax.lalr import Method, Parser, Rule, Tables
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.tree_builder import Builder, ModelBuilder, PropertiesBuilder
from symcheck.syntax.words import IDENTIFIERS, SIGNS, Lexer

if TYPE_CHECKING:
    import lark
    from lark.grammar import Rule as LarkRule

__all__ = ["Language", "analysed", "cache_directory", "grammar_text", "load"]

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


_LAYOUT = "1"
"""The layout of the tables in a file; a change of it needs another number."""

_DIGEST = 8
"""Bytes at the beginning of a file: the digest of the others."""


class Language:
    """The tables of a grammar, and the builder that its parser calls.

    A builder serves one text at a time.
    """

    def __init__(self, tables: Tables, builder: Builder) -> None:
        self.builder = builder
        self._tables = tables
        self._methods: list[Method] = [
            getattr(builder, method, _listed) for _, _, method, _, _ in tables.rules
        ]

    def parser(self, start: str) -> Parser:
        """A parser before the first word of a text."""
        return Parser(self._tables, self._methods, start)

    @cached_property
    def lexer(self) -> Lexer:
        """What finds the words of a text."""
        return Lexer(self._tables.word, self._tables.keywords, self._tables.signs)

    @cached_property
    def spelling(self) -> dict[str, str]:
        """How the words with one spelling are written, by terminal."""
        return {
            terminal: word
            for word, terminal in (self._tables.keywords | self._tables.signs).items()
        }

    def reserves(self, word: str) -> bool:
        """Whether a word is no name: a keyword, or a function if a parenthesis follows."""
        return self._reserved.match(f"{word}(") is not None

    @cached_property
    def _reserved(self) -> re.Pattern[str]:
        return re.compile(self._tables.reserved)


def _listed(values: list[Any]) -> list[Any]:
    return values


@cache
def load(name: str) -> Language:
    """The language 'prism' or 'properties'."""
    text = _whole_grammar(name)
    path = _cache_file(name, text)
    tables = None if path is None else _read(path)
    if tables is None:
        tables = _tables(analysed(name))
        if path is not None:
            _save(tables, path)
    return Language(tables, _BUILDERS[name]())


def analysed(name: str) -> lark.Lark:
    """What Lark makes of the grammar 'prism' or 'properties'."""
    import lark

    return lark.Lark(
        _whole_grammar(name),
        parser="lalr",
        lexer="basic",
        start=_STARTS[name],
        keep_all_tokens=True,
    )


def _tables(language: lark.Lark) -> Tables:
    """The tables of a grammar that Lark has analysed."""
    from lark.lexer import PatternStr
    from lark.parsers.lalr_analysis import Shift

    (ignored,) = language.lexer_conf.ignore
    # The words are those of Lark's basic lexer: the terminals with the highest priority come first,
    # and a terminal with one spelling wins over `NAME`.
    order = sorted(language.terminals, key=lambda t: (-t.priority, -t.pattern.max_width, t.name))
    patterns = {t.name: t.pattern.to_regexp() for t in order}
    identifier = re.compile(patterns[IDENTIFIERS])
    fixed = {t.pattern.value: t.name for t in order if isinstance(t.pattern, PatternStr)}
    keywords = {word: kind for word, kind in fixed.items() if identifier.fullmatch(word)}
    signs = {word: kind for word, kind in fixed.items() if word not in keywords}
    first = [t.name for t in order if t.name not in fixed.values() and t.priority >= 0]
    last = [t.name for t in order if t.name not in fixed.values() and t.priority < 0]
    any_sign = "|".join(map(re.escape, sorted(signs, key=len, reverse=True)))
    groups = [
        *(f"(?P<{name}>{patterns[name]})" for name in first if name != ignored),
        f"(?P<{SIGNS}>{any_sign})",
        *(f"(?P<{name}>{patterns[name]})" for name in last),
    ]
    no_names = [
        f"(?:{patterns[t.name]})"
        for t in language.terminals
        if t.name not in (IDENTIFIERS, "FOREIGN")
    ]
    table = language.parser.parser._parse_table
    number = {rule: i for i, rule in enumerate(language.rules)}
    return Tables(
        word=rf"(?:{patterns[ignored]})?(?:{'|'.join(groups)}|\Z)",
        keywords=keywords,
        signs=signs,
        reserved=rf"(?:{'|'.join(no_names)})(?=\(\Z)",
        states=[
            {
                str(symbol): argument if action is Shift else ~number[argument]
                for symbol, (action, argument) in table.states[state].items()
            }
            for state in range(len(table.states))
        ],
        rules=[tuple(_rule(rule)) for rule in language.rules],
        starts={
            start: (table.start_states[start], table.end_states[start])
            for start in table.start_states
        },
    )


def _rule(rule: LarkRule) -> Rule:
    """A rule of Lark. It names the parts of rules whose names begin with `_` as its own."""
    is_list = [not s.is_term and s.name.startswith("_") for s in rule.expansion]
    absent = rule.options.empty_indices or [False] * len(is_list)
    symbols = iter(enumerate(is_list))
    parts = tuple((None, False) if is_absent else next(symbols) for is_absent in absent)
    return Rule(
        symbol=str(rule.origin.name),
        size=len(is_list),
        method=str(rule.alias or rule.options.template_source or rule.origin.name),
        is_transparent=rule.options.expand1 and not rule.alias,
        parts=parts if any(is_list) or any(absent) else None,
    )


def grammar_text(name: str) -> str:
    """The text of the grammar 'prism' or 'properties', as installed or as in the source tree."""
    packaged = Path(__file__).parents[1] / "grammar" / f"{name}.lark"
    if packaged.is_file():
        return packaged.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "grammar" / f"{name}.lark").read_text(encoding="utf-8")


def _whole_grammar(name: str) -> str:
    text = grammar_text(name)
    return text + _operations() + _other_types(text)


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
    """The file that holds the tables of this grammar for these versions of Lark and Python."""
    directory = cache_directory()
    if directory is None:
        return None
    parts = (text, repr(_STARTS[name]), _LAYOUT, _lark_version(), sys.version)
    digest = source_hash("\0".join(parts).encode()).hex()
    return directory / f"{name}-{digest}.tables"


def _lark_version() -> str:
    """The text of the file that names Lark's version, which is not imported for it."""
    spec = find_spec("lark")
    loader: Any = spec and spec.loader
    return str(loader.get_source("lark"))


def _read(path: Path) -> Tables | None:
    """The saved tables, or None if they are missing or damaged: then their digest is another."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    digest, written = content[:_DIGEST], content[_DIGEST:]
    return Tables(*marshal.loads(written)) if source_hash(written) == digest else None


def _save(tables: Tables, path: Path) -> None:
    """Save tables. Other processes see the whole file or none, because the draft is renamed."""
    draft = path.with_suffix(f".{os.getpid()}.tmp")
    written = marshal.dumps(tuple(tables))
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        draft.write_bytes(source_hash(written) + written)
        draft.replace(path)
    except OSError:  # the next run analyses the grammar again
        pass
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
