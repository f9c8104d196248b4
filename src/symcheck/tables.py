"""Tables that print as text and as HTML, data frames, and packages that are optional."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

from symcheck.errors import UnsupportedError

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["SHOWN_ROWS", "Table", "data_frame", "optional_package", "state_table"]

SHOWN_ROWS = 10
"""Rows of a table of states that are shown; its last line says how many there are."""

_SHOWN_VARIABLES = 12
"""Columns of variables that are shown; there are hundreds in some models."""


@dataclass(frozen=True, eq=False)
class Table:
    """A table of texts; each row is as long as `head`. `note` is a line below the rows."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def __str__(self) -> str:
        lines = [self.head, *self.rows] if any(self.head) else list(self.rows)
        widths = [max((len(line[i]) for line in lines), default=0) for i in range(len(self.head))]
        texts = [
            "  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip()
            for line in lines
        ]
        return "\n".join([*texts, self.note] if self.note else texts)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.head)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        first = f"<tr>{head}</tr>" if any(self.head) else ""
        note = f"<div>{escape(self.note)}</div>" if self.note else ""
        return f"<table>{first}{rows}</table>{note}"

    @staticmethod
    def of(head: Sequence[str], rows: Iterable[Sequence[object]], note: str = "") -> Table:
        """A table of any values: floats have six significant digits, others are shown by str()."""
        return Table(tuple(head), tuple(tuple(map(_text, row)) for row in rows), note)


def state_table(
    names: Sequence[str],
    rows: Iterable[tuple[int, Sequence[object], object]],
    last: str,
    note: str,
) -> Table:
    """A table of states: number, the first variables, and one more value (none if `last` is '').

    Args:
        names: the variables.
        rows: of each state its number, the values of the variables, and the other value.
        last: the head of the other value.
        note: a line below the rows.
    """
    n = _SHOWN_VARIABLES
    more, dots = (["…"], ("…",)) if len(names) > n else ([], ())
    body = ((i, *s[:n], *dots, value) for i, s, value in rows)
    head = ["state", *names[:n], *more, last]
    if last:
        return Table.of(head, body, note)
    return Table.of(head[:-1], (row[:-1] for row in body), note)


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def data_frame(
    columns: Mapping[str, object], index: Iterable[int], name: str = "state"
) -> DataFrame:
    """A data frame of pandas with a named index. Raises UnsupportedError without pandas."""
    pandas = optional_package("pandas", "frames")
    frame: DataFrame = pandas.DataFrame(dict(columns), index=pandas.Index(index, name=name))
    return frame


def optional_package(name: str, extra: str) -> Any:
    """A package that only some functions need. Raises UnsupportedError if it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise UnsupportedError(
            f"this needs {name}, which is not installed\n  hint: pip install 'symcheck[{extra}]'"
        ) from None
