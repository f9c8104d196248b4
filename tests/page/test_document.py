"""The text of a page: data survive, and nothing in them ends the script."""

from __future__ import annotations

import json
import re
from html import unescape
from typing import Any

from symcheck.page import document, fragment


def content(page: str) -> dict[str, Any]:
    """The data of a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data: dict[str, Any] = json.loads(found[1])
    return data


def test_data_are_in_the_page_as_they_were_given() -> None:
    text = "dtmc // </script><script>alert(1)</script> @DATA@ @TITLE@ \\1"
    data = {"title": "a < b", "text": text, "shows": []}
    page = document(data)
    assert content(page) == {**data, "graphs": []}
    assert "<title>a &lt; b</title>" in page
    assert page.count("</script>") == 2
    assert "@SCRIPT@" not in page


def test_a_page_needs_no_network() -> None:
    page = document({"title": "die"})
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)|url\(|@import|fetch\(|import\(""", page)


def test_a_fragment_holds_a_whole_page() -> None:
    inner = re.search(r'srcdoc="([^"]*)"', fragment({"title": "x", "text": 'say "hi"'}))
    assert inner is not None
    assert content(unescape(inner[1]))["text"] == 'say "hi"'
