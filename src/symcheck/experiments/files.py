"""Tables and plots of rows as files, by their extension."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import isfinite
from pathlib import Path

from symcheck.experiments.rows import Row, records
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.semantics.expressions.literals import format_value
from symcheck.tables import optional_package, plain_text
from symcheck.whole_file import extension_of, write_whole

__all__ = ["EXTENSIONS", "check_extension", "json_text", "save"]

Records = Sequence[Mapping[str, object]]

_PLOT = ("matplotlib", "plot")
EXTENSIONS: Mapping[str, tuple[str, str] | None] = {
    ".csv": None,
    ".json": None,
    ".parquet": ("pyarrow", "frames"),
    ".png": _PLOT,
    ".svg": _PLOT,
    ".pdf": _PLOT,
}
"""The extensions, with the package that each needs, and the extra that installs it."""


def check_extension(path: str | Path) -> str:
    """The extension of a file, which can be written.

    Raises:
        UsageError: it is unknown.
        UnsupportedError: it needs a package that is not installed.
    """
    extension = extension_of(path, EXTENSIONS, "how results are written")
    needed = EXTENSIONS[extension]
    if needed is not None:
        optional_package(*needed)
    return extension


def save(rows: Sequence[Row], varying: Sequence[str], path: str | Path) -> None:
    """Write a table or a plot of rows, whole or not at all. Raises as `check_extension`."""
    extension = check_extension(path)

    def write(temporary: Path) -> None:
        match extension:
            case ".csv":
                _write_csv(temporary, records(rows))
            case ".json":
                temporary.write_text(json_text(rows), encoding="utf-8")
            case ".parquet":
                _write_parquet(temporary, records(rows))
            case _:
                from symcheck.experiments.plot import save_plot

                save_plot(rows, varying, temporary, extension[1:])

    write_whole(path, write)


def _write_csv(path: Path, table: Records) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table[0] if table else ())
        writer.writerows([_text(v) for v in record.values()] for record in table)


def _text(value: object) -> str:
    match value:
        case None:
            return ""
        case bool() | int() | float() | Fraction():
            return format_value(value)
        case tuple() | list():
            return f"[{','.join(map(_text, value))}]"
        case _:
            return str(value)


def json_text(rows: Sequence[Row]) -> str:
    """A list of objects, one on each line."""
    objects = ({name: _plain(v) for name, v in record.items()} for record in records(rows))
    lines = ",\n ".join(json.dumps(o, ensure_ascii=False) for o in objects)
    return f"[{lines}]\n"


def _plain(value: object) -> object:
    """The value in JSON, which has no rationals and no infinite numbers: they are texts."""
    match value:
        case tuple() | list():
            return [_plain(v) for v in value]
        case Fraction() | RationalFunction():
            return plain_text(value)
        case float() if not isfinite(value):
            return format_value(value)
        case _:
            return value


def _write_parquet(path: Path, table: Records) -> None:
    import pyarrow
    from pyarrow import parquet

    names = table[0] if table else ()
    columns = {name: _column([record[name] for record in table]) for name in names}
    parquet.write_table(pyarrow.table(columns), path)


def _column(values: Sequence[object]) -> list[object]:
    """Values of one type: as they are, as floats if they are numbers, or as texts."""
    given = [v for v in values if v is not None]
    kinds = {type(v) for v in given}
    if len(kinds) < 2 and kinds <= {bool, float, str}:
        return list(values)
    if kinds == {int} and all(isinstance(v, int) and abs(v) < 1 << 63 for v in given):
        return list(values)
    if kinds <= {bool, int, float}:
        return [float(v) if isinstance(v, int | float) else None for v in values]
    return [None if v is None else _text(v) for v in values]
