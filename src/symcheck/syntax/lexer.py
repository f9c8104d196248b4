"""Words of a text, as parallel lists of numbers: kinds, starts and ends. White space and comments are left out."""

from __future__ import annotations

from dataclasses import dataclass

from symcheck.syntax.grammars import Grammar

__all__ = ["FOREIGN", "KEYWORDS", "RESERVED", "Words", "scan"]

FOREIGN = -1
"""Kind of a character that starts no word of the language."""

RESERVED = -2
"""Kind of a word that is reserved, but has no place in this kind of text."""

KEYWORDS = frozenset(
    {
        *(
            "A",
            "C",
            "E",
            "F",
            "G",
            "I",
            "P",
            "Pmax",
            "Pmin",
            "R",
            "Rmax",
            "Rmin",
            "S",
            "U",
            "W",
            "X",
            "bool",
            "clock",
            "const",
            "ctmc",
        ),
        *(
            "double",
            "dtmc",
            "endinit",
            "endinvariant",
            "endmodule",
            "endrewards",
            "endsystem",
            "false",
            "filter",
            "formula",
            "func",
        ),
        *(
            "global",
            "init",
            "int",
            "invariant",
            "label",
            "max",
            "mdp",
            "min",
            "module",
            "nondeterministic",
            "prob",
            "probabilistic",
        ),
        *("pta", "rate", "rewards", "stochastic", "system", "true"),
    }
)
"""The reserved words of models and properties together: none of them can be a name in either."""


@dataclass(slots=True)
class Words:
    """Word i is `text[starts[i]:ends[i]]`, of kind `kinds[i]`. The last one is the empty word at the end."""

    text: str
    kinds: list[int]
    starts: list[int]
    ends: list[int]

    def __getitem__(self, i: int) -> str:
        """The characters of word i."""
        return self.text[self.starts[i] : self.ends[i]]

    def __len__(self) -> int:
        return len(self.kinds)

    def insert(self, i: int, kind: int) -> None:
        """Put an empty word of this kind before word i, right behind the word before it."""
        at = self.ends[i - 1] if i else self.starts[i]
        self.kinds.insert(i, kind)
        self.starts.insert(i, at)
        self.ends.insert(i, at)

    def delete(self, i: int) -> None:
        """Take word i out."""
        del self.kinds[i], self.starts[i], self.ends[i]


def scan(text: str, grammar: Grammar) -> Words:
    """All words of a text. Never fails: what is no word becomes one of kind FOREIGN."""
    kinds: list[int] = []
    starts: list[int] = []
    ends: list[int] = []
    literals = grammar.literals
    name = grammar.kinds["NAME"]
    fixed = [FOREIGN, *(kind for kind, _ in grammar.patterns)]
    signs = len(fixed)
    for match in grammar.scanner.finditer(text):
        group = match.lastindex
        if group is None:
            break
        start, end = match.span(group)
        if group < signs:
            kind = fixed[group]
            if kind == name:
                word = match[group]
                kind = literals.get(word, RESERVED if word in KEYWORDS else name)
        else:
            kind = literals[match[group]] if group == signs else FOREIGN
        kinds.append(kind)
        starts.append(start)
        ends.append(end)
    kinds.append(grammar.end)
    starts.append(len(text))
    ends.append(len(text))
    return Words(text, kinds, starts, ends)
