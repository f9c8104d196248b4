"""Results of a sweep as tables: one row for each property and choice of constants."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from symcheck.errors import UsageError

__all__ = ["FORMATS", "Row", "render"]


@dataclass(frozen=True, slots=True)
class Row:
    """One result. `property`: name or text; `constants`: the ones that vary or were given; `value`, `accuracy` as text."""

    property: str
    constants: Mapping[str, str]
    value: str
    accuracy: str = ""
    results: tuple[str, ...] = field(default=(), compare=False)


def _groups(rows: Iterable[Row]) -> list[tuple[str, list[Row]]]:
    return [(name, list(group)) for name, group in groupby(rows, key=lambda r: r.property)]


def _lines(rows: Sequence[Sequence[str]], separator: str) -> str:
    if separator == ",":
        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows(rows)
        return out.getvalue()
    return "".join(separator.join(row) + "\n" for row in rows)


def _list(rows: Sequence[Row], separator: str) -> str:
    """Each property with its own small table: constants, then the result."""
    parts = []
    groups = _groups(rows)
    for name, group in groups:
        names = list(group[0].constants)
        body = _lines([[*names, "Result"], *([*(r.constants[n] for n in names), r.value] for r in group)], separator)
        title = f"{name}:\n" if separator != "," else _lines([[name]], separator)
        parts.append((title if len(groups) > 1 else "") + body)
    return "\n".join(parts)


def _matrix(rows: Sequence[Row], separator: str) -> str:
    """Each property as a matrix: the last constant across, the others down."""
    parts = []
    groups = _groups(rows)
    for name, group in groups:
        # A constant that does not vary would be a side of length 1.
        names = [n for n in group[0].constants if len({r.constants[n] for r in group}) > 1] or list(group[0].constants)
        if not names:
            body = _lines([[group[0].value]], separator)
        else:
            *down, across = names
            columns = list(dict.fromkeys(r.constants[across] for r in group))
            cells = {(tuple(r.constants[d] for d in down), r.constants[across]): r.value for r in group}
            heads = list(dict.fromkeys(key for key, _ in cells))
            corner = [f"{', '.join(down)} \\ {across}" if down else across]
            table = [[*corner, *columns]]
            table += [[", ".join(h), *(cells.get((h, c), "") for c in columns)] for h in heads]
            body = _lines(table, separator)
        title = f"{name}:\n" if separator != "," else _lines([[name]], separator)
        parts.append((title if len(groups) > 1 else "") + body)
    return "\n".join(parts)


def _dataframe(rows: Sequence[Row]) -> str:
    """One table for all, as a data frame reads it: property, every constant, result, accuracy."""
    names = list(dict.fromkeys(n for r in rows for n in r.constants))
    body = [[r.property, *(r.constants.get(n, "") for n in names), r.value, r.accuracy] for r in rows]
    return _lines([["Property", *names, "Result", "Accuracy"], *body], ",")


def _comment(rows: Sequence[Row]) -> str:
    """RESULT lines, to be put above the properties of a file that is to be tested."""
    parts = []
    for name, group in _groups(rows):
        lines = []
        for r in group:
            constants = ",".join(f"{k}={v}" for k, v in r.constants.items())
            lines.append(f"// RESULT{f' ({constants})' if constants else ''}: {r.value}")
        parts.append("\n".join([*lines, name]) + "\n")
    return "\n".join(parts)


def _json(rows: Sequence[Row]) -> str:
    """A list of objects: property, constants and result as text (a number has the digits that give it back), and accuracy."""
    import json

    found = [{"property": r.property, "constants": dict(r.constants), "result": r.value, "accuracy": r.accuracy} for r in rows]
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


FORMATS = ("text", "csv", "matrix", "dataframe", "comment", "json")


def render(rows: Sequence[Row], kinds: Sequence[str]) -> str:
    """The rows in a format: `text`, `csv`, `matrix` (also with `csv`), `dataframe`, `comment` or `json`. Raises UsageError."""
    unknown = [k for k in kinds if k not in FORMATS]
    if unknown:
        raise UsageError(f"-exportresults: unknown format '{unknown[0]}'\n  hint: known are {', '.join(FORMATS)}")
    separator = "," if "csv" in kinds else "\t"
    if "matrix" in kinds:
        return _matrix(rows, separator)
    if "dataframe" in kinds:
        return _dataframe(rows)
    if "comment" in kinds:
        return _comment(rows)
    if "json" in kinds:
        return _json(rows)
    return _list(rows, separator)
