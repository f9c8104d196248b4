"""The grammar for colours in editors says the same as the language server."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from symcheck.lsp.answers import Document
from symcheck.syntax.grammars import load

ROOT = Path(__file__).parents[2]
GRAMMAR = json.loads((ROOT / "editors" / "prism.tmLanguage.json").read_text(encoding="utf-8"))
SCOPES = {
    "comment": ("comment.",),
    "number": ("constant.numeric.",),
    "function": ("support.function.", "keyword.operator.temporal."),  # max in filter(max, …)
    "keyword": ("keyword.", "storage.", "constant.language."),
    "string": ("string.",),
    "event": ("entity.name.function.action.", ""),  # with a colour where a line begins with it
}
"""Scopes of the grammar by types of semantic tokens; other names have no colour of their own."""


def rules(name: str) -> list[tuple[re.Pattern[str], dict[str, Any]]]:
    """The rules that a part of the grammar includes, with their patterns."""
    part = GRAMMAR["repository"][name]
    return [(re.compile(rule["match"]), rule) for rule in part.get("patterns", [part])]


RULES = [rule for one in GRAMMAR["patterns"] for rule in rules(one["include"].lstrip("#"))]


def scopes(line: str) -> list[str]:
    """The scope of each character, as editors find it: the first match, then the first rule."""
    found, at = [""] * len(line), 0
    while True:
        hits = [(m.start(), i, m) for i, (p, _) in enumerate(RULES) if (m := p.search(line, at))]
        if not hits:
            return found
        _, number, match = min(hits, key=lambda hit: hit[:2])
        rule = RULES[number][1]
        parts = {**({"0": rule} if "name" in rule else {}), **rule.get("captures", {})}
        for group, part in parts.items():
            start, end = match.span(int(group))
            found[start:end] = [part["name"]] * (end - start)
        at = max(match.end(), at + 1)


MODELS = sorted((ROOT / "models").rglob("*.*m")) + sorted((ROOT / "models").rglob("*.prism"))
PROPERTIES = sorted(
    p for end in ("*.pctl", "*.csl", "*.props") for p in (ROOT / "models").rglob(end)
)


@pytest.mark.parametrize("path", [*MODELS, *PROPERTIES], ids=lambda path: path.name)
def test_colours_are_those_of_the_server(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    language = "prism" if path in MODELS else "properties"
    coloured = [scope for line in text.split("\n") for scope in (*scopes(line), "")]
    for start, end, kind in Document(path.as_uri(), text, language).colours():
        wanted, word = SCOPES.get(kind, ("",)), text[start:end]
        for scope in set(coloured[start:end]):
            assert any(scope.startswith(w) if w else not scope for w in wanted), (word, kind, scope)


@pytest.mark.parametrize("language", ["prism", "properties"])
def test_every_keyword_has_a_colour(language: str) -> None:
    for word in (w for w in load(language).spelling.values() if w[0].isalpha()):
        following = " [" if word in ("A", "E") else " ("
        assert all(scopes(word + following)[: len(word)]), word
