"""Tables that print as text, and as HTML in a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from symcheck.check.result import show_value

if TYPE_CHECKING:
    from symcheck.check.result import Result

__all__ = ["Table", "results"]


@dataclass(frozen=True, eq=False)
class Table:
    """A table of texts; each row is as long as `head`."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __str__(self) -> str:
        lines = [self.head, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.head))]
        return "\n".join(
            "  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip()
            for line in lines
        )

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.head)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        return f"<table><tr>{head}</tr>{rows}</table>"

    @staticmethod
    def of(head: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
        """A table of any values: floats have six significant digits, others are shown by str()."""
        return Table(
            tuple(head),
            tuple(
                tuple(f"{c:.6g}" if isinstance(c, float) else str(c) for c in row) for row in rows
            ),
        )


def results(answers: Iterable[tuple[str, Result]]) -> Table:
    """A table of results.

    Args:
        answers: pairs of a property's text and its result.
    """
    return Table.of(
        ("property", "value", "accuracy"),
        [(name, show_value(r.value), r.accuracy) for name, r in answers],
    )
