"""Tables of results: one row for each property and combination of constants."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from symcheck.errors import UsageError

__all__ = ["FORMATS", "Row", "render"]


@dataclass(frozen=True, slots=True)
class Row:
    """One result.

    Attributes:
        property: its name or text.
        constants: the given constants, with their values as texts.
        value: as text.
        accuracy: as text.
        title: the heading above the results of the property, its name and text; empty for
            `property`.
        fixed: the constants that were given one value only: lists and matrices omit them.
    """

    property: str
    constants: Mapping[str, str]
    value: str
    accuracy: str = ""
    results: tuple[str, ...] = field(default=(), compare=False)
    title: str = field(default="", compare=False)
    fixed: tuple[str, ...] = field(default=(), compare=False)


def _groups(rows: Iterable[Row]) -> list[tuple[str, list[Row]]]:
    """The rows of each property, under its title."""
    groups = (list(group) for _, group in groupby(rows, key=lambda r: r.property))
    return [(group[0].title or group[0].property, group) for group in groups]


def _varying(group: Sequence[Row]) -> list[str]:
    """The constants that were given several values."""
    return [n for n in group[0].constants if n not in group[0].fixed]


def _lines(rows: Sequence[Sequence[str]], separator: str) -> str:
    if separator == ",":
        import csv

        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows(rows)
        return out.getvalue()
    return "".join(separator.join(row) + "\n" for row in rows)


def _titled(groups: Sequence[tuple[str, list[Row]]], bodies: Sequence[str], separator: str) -> str:
    """The tables one after the other; several tables have titles."""
    if len(groups) == 1:
        return bodies[0]
    titles = [
        _lines([[name]], separator) if separator == "," else f"{name}:\n" for name, _ in groups
    ]
    return "\n".join(title + body for title, body in zip(titles, bodies, strict=True))


def _list(rows: Sequence[Row], separator: str) -> str:
    """One table per property: the constants that vary, and the result."""
    groups = _groups(rows)
    bodies = []
    for _, group in groups:
        names = _varying(group)
        bodies.append(
            _lines(
                [[*names, "Result"], *([*(r.constants[n] for n in names), r.value] for r in group)],
                separator,
            )
        )
    return _titled(groups, bodies, separator)


def _matrix(rows: Sequence[Row], separator: str) -> str:
    """Matrices for each property, one per combination of all but the last two varying constants.

    The last constant is across, and the one before it is down.
    """
    groups = _groups(rows)
    return _titled(groups, [_matrices(group, separator) for _, group in groups], separator)


def _matrices(group: Sequence[Row], separator: str) -> str:
    names = _varying(group)
    if not names:
        return _lines([[group[0].value]], separator)
    *others, across = names
    columns = list(dict.fromkeys(r.constants[across] for r in group))
    if not others:
        heading, table = across, [columns, [r.value for r in group]]
        return _headed(heading, table, separator)
    *others, down = others
    parts = []
    for choice in dict.fromkeys(tuple(r.constants[n] for n in others) for r in group):
        chosen = [r for r in group if tuple(r.constants[n] for n in others) == choice]
        cells = {(r.constants[down], r.constants[across]): r.value for r in chosen}
        table = [["", *columns]]
        table += [
            [head, *(cells.get((head, c), "") for c in columns)]
            for head in dict.fromkeys(r.constants[down] for r in chosen)
        ]
        fixed = [f"{n}={v}" for n, v in zip(others, choice, strict=True)]
        parts.append(_headed(", ".join([*fixed, f"{down}\\{across}"]), table, separator))
    return "\n".join(parts)


def _headed(heading: str, table: Sequence[Sequence[str]], separator: str) -> str:
    return (_lines([[heading]], separator) if separator == "," else f"{heading}:\n") + _lines(
        table, separator
    )


def _dataframe(rows: Sequence[Row]) -> str:
    """One table in the form of a data frame: property, every constant, result, accuracy."""
    names = list(dict.fromkeys(n for r in rows for n in r.constants))
    body = [
        [r.property, *(r.constants.get(n, "") for n in names), r.value, r.accuracy] for r in rows
    ]
    return _lines([["Property", *names, "Result", "Accuracy"], *body], ",")


def _comment(rows: Sequence[Row]) -> str:
    """RESULT lines for -test, to be copied above the properties of a file."""
    parts = []
    groups = _groups(rows)
    for name, group in groups:
        lines = []
        for r in group:
            constants = ",".join(f"{k}={v}" for k, v in r.constants.items())
            lines.append(f"// RESULT{f' ({constants})' if constants else ''}: {r.value}")
        parts.append("\n".join([*lines, *([name] if len(groups) > 1 else [])]) + "\n")
    return "\n".join(parts)


def _json(rows: Sequence[Row]) -> str:
    """A list of objects: property, constants, accuracy, and the result with all digits."""
    import json

    found = [
        {
            "property": r.property,
            "constants": dict(r.constants),
            "result": r.value,
            "accuracy": r.accuracy,
        }
        for r in rows
    ]
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


FORMATS = ("text", "csv", "matrix", "dataframe", "comment", "json")


def render(rows: Sequence[Row], kinds: Sequence[str]) -> str:
    """The text of some rows.

    Args:
        rows: those of each property together.
        kinds: one of `FORMATS`; `matrix` may be combined with `csv`.

    Raises:
        UsageError: a format is unknown.
    """
    unknown = [k for k in kinds if k not in FORMATS]
    if unknown:
        raise UsageError(
            f"-exportresults: unknown format '{unknown[0]}'"
            f"\n  hint: the formats are {', '.join(FORMATS)}"
        )
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
