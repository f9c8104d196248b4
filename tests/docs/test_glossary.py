"""The glossary lists each term once, in order, with a sentence and a source."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = [
    " ".join(entry.split())
    for entry in re.split(r"^- ", (ROOT / "docs" / "glossary.md").read_text(), flags=re.MULTILINE)[
        1:
    ]
]


def test_terms_are_unique_and_ordered() -> None:
    terms = [re.match(r"\*\*([^*]+)\*\*", entry)[1].lower() for entry in ENTRIES]  # type: ignore[index]
    assert terms == sorted(set(terms))


@pytest.mark.parametrize("entry", ENTRIES, ids=[e.split("**")[1] for e in ENTRIES])
def test_an_entry_is_a_sentence_with_a_source(entry: str) -> None:
    found = re.fullmatch(r"\*\*[^*]+\*\*: (.{20,}[.:;]) \((.+)\)", entry)
    assert found, entry
    for path in re.findall(r"`(\w+(?:/\w+)+(?:\.py)?)`", found[2]):
        assert (ROOT / "src" / "symcheck" / path).exists(), path
