"""Tables that print as text and as HTML, data frames, and packages that are optional."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from importlib import import_module
from itertools import islice, zip_longest
from types import ModuleType
from typing import TYPE_CHECKING

from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from pandas import DataFrame

__all__ = [
    "SHOWN_ROWS",
    "Columns",
    "Table",
    "Tabular",
    "counted",
    "optional_package",
    "plain_text",
    "state_table",
]

SHOWN_ROWS = 10
"""Rows of a long table that are shown; a row of dots and its last line say that there are more."""

_SHOWN_VARIABLES = 12
"""Columns of variables that are shown; there are hundreds in some models."""


Columns = Mapping[str, "Sequence[object] | NDArray[np.generic]"]
"""The columns of a table by name, all of one length."""


def counted(number: int, noun: str) -> str:
    """A number with its noun: `1 state`, `2 states`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


class Tabular:
    """What prints as a table of its first rows, and becomes a data frame."""

    def _table(self) -> Table:
        raise NotImplementedError

    def columns(self) -> Columns:
        """Sequences of the same length by name; the first one numbers the rows."""
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self._table())

    def _repr_html_(self) -> str:
        return self._table()._repr_html_()

    def to_frame(self) -> DataFrame:
        """The columns as a data frame of pandas. Raises UnsupportedError without pandas."""
        columns = self.columns()
        frame: DataFrame = optional_package("pandas", "frames").DataFrame(columns)
        return frame.set_index(next(iter(columns)))


@dataclass(frozen=True, eq=False)
class Table:
    """A table of texts; each row is as long as `head`. `note` is a line below the rows.

    In print, a cell of more than `widest` characters takes several lines (0: each cell takes one),
    except in the last column.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    widest: int = 0

    def __str__(self) -> str:
        rows = [self.head, *self.rows] if any(self.head) else list(self.rows)
        lines = [line for row in rows for line in _wrapped(row, self.widest)]
        widths = [max((len(line[i]) for line in lines), default=0) for i in range(len(self.head))]
        texts = [
            "  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip()
            for line in lines
        ]
        return "\n".join([*texts, self.note] if self.note else texts)

    def _repr_html_(self) -> str:
        from html import escape  # seven milliseconds

        head = "".join(f"<th>{escape(cell)}</th>" for cell in self.head)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in self.rows
        )
        first = f"<tr>{head}</tr>" if any(self.head) else ""
        note = f"<div>{escape(self.note)}</div>" if self.note else ""
        return f"<table>{first}{rows}</table>{note}"

    @staticmethod
    def of(
        head: Sequence[str],
        rows: Iterable[Sequence[object]],
        note: str = "",
        most: int | None = None,
    ) -> Table:
        """A table of any values: floats have six significant digits, others are shown by str().

        Args:
            head: the names of the columns.
            rows: the cells.
            note: a line below the rows.
            most: rows that are shown; one of dots follows if there are more. None for all.
        """
        shown = list(rows if most is None else islice(rows, most + 1))
        if most is not None and len(shown) > most:
            shown[most] = ["…"] * len(head)
        return Table(tuple(head), tuple(tuple(map(_text, row)) for row in shown), note)


def state_table(
    names: Sequence[str],
    rows: Iterable[tuple[int, Sequence[object], *tuple[object, ...]]],
    last: Sequence[str],
    note: str,
) -> Table:
    """A table of the first states: number, the first variables, and more values.

    Args:
        names: the variables.
        rows: of each state its number, the values of the variables, and more values.
        last: the heads of the latter.
        note: a line below the rows.
    """
    n = _SHOWN_VARIABLES
    dots = ["…"] * (len(names) > n)
    body = ((i, *state[:n], *dots, *more) for i, state, *more in rows)
    return Table.of(["state", *names[:n], *dots, *last], body, note, SHOWN_ROWS)


def _wrapped(row: tuple[str, ...], widest: int) -> list[tuple[str, ...]]:
    """The lines of a row whose cells but the last have at most so many characters (0: no limit)."""
    if not any(len(cell) > widest > 0 for cell in row[:-1]):
        return [row]
    from textwrap import wrap  # only few tables are that wide

    cells = [wrap(cell, widest) for cell in row[:-1]]
    return list(zip_longest(*cells, [row[-1]], fillvalue=""))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else plain_text(value)


def plain_text(value: object) -> str:
    """str(value), also of a rational number with more digits than Python writes."""
    if isinstance(value, Fraction):
        below = f"/{_digits(value.denominator)}" if value.denominator != 1 else ""
        return _digits(value.numerator) + below
    return _digits(value) if isinstance(value, int) else str(value)


def _digits(number: int) -> str:
    try:
        return str(number)
    except ValueError:
        half = number.bit_length() * 3 // 20  # of the digits, of which a bit makes 0.3
        high, low = divmod(abs(number), 10**half)
        return "-" * (number < 0) + _digits(high) + _digits(low).zfill(half)


def optional_package(name: str, extra: str) -> ModuleType:
    """A package that only some functions need. Raises UnsupportedError if it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise UnsupportedError(
            f"this needs {name}, which is not installed", hint=f"pip install 'symcheck[{extra}]'"
        ) from None
