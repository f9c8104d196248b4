"""Web pages with graphs and a player of frames, written from plain data.

`page.html`, `page.css` and `page.js` become one file that needs no network. The package knows
neither models nor diagrams: `symcheck.teach.model_page` says what a page shows.
"""

from __future__ import annotations

from symcheck.page.document import document, fragment

__all__ = ["document", "fragment"]
