"""The places of a text where a computation in doubles would take another decision.

Conditions are decided in exact arithmetic. Tools that decide them in doubles, such as PRISM, may
build another model; so the places are kept with the text, for a note.
"""

from __future__ import annotations

from symcheck.errors import Source
from symcheck.syntax.ast import Node

__all__ = ["note", "notes_about"]


def note(node: Node) -> None:
    """Note that doubles decide a node of a text differently in some state."""
    span = node.span
    if span.text:
        span.source.rounded.setdefault((span.start, span.end), span)


def notes_about(source: Source) -> tuple[str, ...]:
    """A sentence for each place that was noted in a text."""
    return tuple(
        f"{span}: `{' '.join(span.text.split())}` is evaluated in exact arithmetic; tools that "
        "round to doubles, such as PRISM, get another answer for some values"
        for _, span in sorted(source.rounded.items())
    )
