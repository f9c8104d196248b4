"""The HTML text of a page, and of a page inside a notebook.

The data of a page is a mapping that page.js reads:

- title, note: texts; facts: pairs of texts; text: the text of the model
- graphs: SVG texts, as Graphviz writes them
- properties: {text, value, detail, show}, where `show` is the number of a show or null
- shows: {group, name, note, panes, frames, keys, play}: a sequence of frames, the numbers of the
  graphs beside each other, pairs (class, meaning), and 'simulator' for `play` if the frames are a
  walk through the model
- a frame: {title, note, panes, marks, low, high, rows}: `marks` are triples (graph, class, names of
  nodes), `low` and `high` numbers or texts per state, `rows` the chosen rows of the matrix
- model: {kind, states, rows, labels, rewards, initial, strategies}: what the simulator walks on;
  `labels` has those of each state, and `rewards` pairs (structure, reward of each state)
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from typing import Any

__all__ = ["JsonObject", "JsonValue", "document", "fragment"]

JsonValue = Any
"""A value that `json` writes. The script of the page reads it; it has no type in Python."""
JsonObject = dict[str, JsonValue]

_PROLOGUE = re.compile(r"^.*?(?=<svg)", re.DOTALL)
_COMMENT = re.compile(r"<!--.*?-->\s*", re.DOTALL)


def document(data: Mapping[str, JsonValue]) -> str:
    """One self-contained HTML file.

    Args:
        data: as described above; every part but the title may be missing.
    """
    folder = files("symcheck.page")
    style, script, page = (
        folder.joinpath(f"page.{kind}").read_text(encoding="utf-8")
        for kind in ("css", "js", "html")
    )
    graphs = [_COMMENT.sub("", _PROLOGUE.sub("", g)) for g in data.get("graphs", ())]
    # '<' is escaped, so that no text of a model ends the script.
    whole = {**data, "graphs": graphs}
    text = json.dumps(whole, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    parts = {
        "TITLE": escape(str(data.get("title", "symcheck"))),
        "STYLE": style,
        "SCRIPT": script,
        "DATA": text.replace("<", "\\u003c"),
    }
    return re.sub("@(TITLE|STYLE|SCRIPT|DATA)@", lambda match: parts[match[1]], page)


def fragment(data: Mapping[str, JsonValue], height: int = 560) -> str:
    """The page as a frame inside another page, such as a notebook; `height` in pixels."""
    inner = escape(document({**data, "embedded": True}), quote=True)
    title = escape(str(data.get("title", "symcheck")), quote=True)
    style = f"width:100%;height:{height}px;border:1px solid #ddd"
    return f'<iframe title="{title}" srcdoc="{inner}" style="{style}"></iframe>'
