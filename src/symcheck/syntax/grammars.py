"""The grammar files, and the LALR tables made from them.

The grammars themselves (`grammar/*.lark`) are Lark's. Lark turns them into tables once, with
`python -m symcheck.syntax.generate`, which writes `symcheck.syntax.tables`; a run reads only those, so that it needs
neither Lark nor the time to build an automaton. A test compares the tables with the grammars.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

__all__ = ["Grammar", "Packed", "Rule", "load", "read"]

# What `generate` writes: terminals, literals, patterns, rules, rows, row of each state, gotos, starts.
Packed = tuple[
    tuple[str, ...],
    tuple[tuple[str, int], ...],
    tuple[tuple[int, str], ...],
    tuple[tuple[str, int, str | None, tuple[int | None, ...]], ...],
    tuple[tuple[int, ...], ...],
    tuple[int, ...],
    tuple[tuple[str | int, ...], ...],
    tuple[tuple[str, int, int], ...],
]

_SKIP = r"(?:[ \t\r\n\f]++|//[^\r\n]*+)*+"


@dataclass(frozen=True, slots=True)
class Rule:
    """`head: body`, where body has `length` symbols.

    `action` names the function that builds the node; None passes the only kept symbol on. `shape` lists what the
    function gets: i is the value of symbol i, ~i the values of the list that symbol i holds, None an absent option.
    An action of "" makes a list, for the caller to take up.
    """

    head: str
    length: int
    action: str | None
    shape: tuple[int | None, ...]


@dataclass(frozen=True)
class Grammar:
    """An LALR(1) grammar. Kinds of words are numbered as in `terminals`; the last one is the end of the text.

    `rows[state]` maps a kind to an action: s >= 0 shifts and goes to state s, ~r reduces by rule r.
    `gotos[state]` maps the head of a rule to a state. `starts` maps a start symbol to its first and last state.
    """

    terminals: tuple[str, ...]
    literals: Mapping[str, int]
    patterns: tuple[tuple[int, str], ...]
    rules: tuple[Rule, ...]
    rows: tuple[Mapping[int, int], ...]
    gotos: tuple[Mapping[str, int], ...]
    starts: Mapping[str, tuple[int, int]]

    @property
    def end(self) -> int:
        """The kind of the end of the text."""
        return len(self.terminals) - 1

    @cached_property
    def kinds(self) -> Mapping[str, int]:
        """The number of each terminal, by name."""
        return {name: i for i, name in enumerate(self.terminals)}

    @cached_property
    def spelling(self) -> Mapping[int, str]:
        """How the words with one spelling are written, by kind."""
        return {kind: text for text, kind in self.literals.items()}

    @cached_property
    def scanner(self) -> re.Pattern[str]:
        """Matches white space and comments and then one word: group i is `patterns[i-1]`, next come signs, then anything."""
        signs = sorted((t for t in self.literals if not t[0].isalpha()), key=len, reverse=True)
        groups = [f"({pattern})" for _, pattern in self.patterns] + [
            f"({'|'.join(map(re.escape, signs))})",
            "(.)",
        ]
        return re.compile(f"{_SKIP}(?:{'|'.join(groups)}|\\Z)", re.DOTALL)


def read(name: str) -> str:
    """Text of a grammar file, such as 'prism.lark': the installed one, else the repository's."""
    from importlib import resources  # here, as it costs 5 ms and no run needs the texts

    packaged = resources.files("symcheck").joinpath("grammar", name)
    if packaged.is_file():
        return packaged.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "grammar" / name).read_text(encoding="utf-8")


@cache
def load(name: str) -> Grammar:
    """The tables of 'prism' or 'properties'."""
    from symcheck.syntax import tables

    return unpack(
        json.loads((tables.PRISM if name == "prism" else tables.PROPERTIES).replace("\n", ""))
    )


def unpack(packed: Packed) -> Grammar:
    """A grammar from its generated tables."""
    terminals, literals, patterns, rules, rows, row_of, gotos, starts = packed
    unique = [dict(zip(row[::2], row[1::2], strict=True)) for row in rows]
    return Grammar(
        terminals=tuple(terminals),
        literals=dict(literals),
        patterns=tuple((kind, pattern) for kind, pattern in patterns),
        rules=tuple(
            Rule(head, length, action, tuple(shape)) for head, length, action, shape in rules
        ),
        rows=tuple(unique[i] for i in row_of),
        gotos=tuple(dict(zip(g[::2], g[1::2], strict=True)) for g in gotos),  # type: ignore[arg-type]
        starts={symbol: (first, last) for symbol, first, last in starts},
    )
