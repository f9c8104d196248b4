"""Tables of rows as texts, in the formats of PRISM's switch -exportresults."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import NamedTuple

from symcheck.errors import UsageError
from symcheck.experiments.files import json_text
from symcheck.experiments.rows import Row, constant_names, constant_text

__all__ = ["FORMATS", "render"]


class _Group(NamedTuple):
    """The results of one property.

    title: the heading, with name and text of the property. names: its constants with several
    values. cells: for each row the values of these constants, and the result.
    """

    title: str
    names: list[str]
    cells: list[list[str]]


def _groups(rows: Sequence[Row], varying: Sequence[str]) -> list[_Group]:
    result = []
    for name in dict.fromkeys(r.name for r in rows):
        of_property = [r for r in rows if r.name == name]
        formula = of_property[0].formula
        title = f'"{name}": {formula}' if formula not in ("", name) else name
        names = [n for n in of_property[0].constants if n in varying]
        cells = [[*(constant_text(r.constants[n]) for n in names), r.text] for r in of_property]
        result.append(_Group(title, names, cells))
    return result


def _lines(rows: Sequence[Sequence[str]], separator: str) -> str:
    if separator == ",":
        import csv

        out = io.StringIO()
        csv.writer(out, lineterminator="\n").writerows(rows)
        return out.getvalue()
    return "".join(separator.join(row) + "\n" for row in rows)


def _titled(groups: Sequence[_Group], bodies: Sequence[str], separator: str) -> str:
    """The tables one after the other; several tables have titles."""
    if len(groups) == 1:
        return bodies[0]
    titles = [
        _lines([[g.title]], separator) if separator == "," else f"{g.title}:\n" for g in groups
    ]
    return "\n".join(title + body for title, body in zip(titles, bodies, strict=True))


def _list(group: _Group, separator: str) -> str:
    """The constants with several values, and the result."""
    return _lines([[*group.names, "Result"], *group.cells], separator)


def _matrix(group: _Group, separator: str) -> str:
    """A matrix for each combination of all but the last two constants with several values.

    The last constant is across, and the one before it is down.
    """
    if not group.names:
        return _lines(group.cells[:1], separator)
    columns = list(dict.fromkeys(row[-2] for row in group.cells))
    if len(group.names) == 1:
        return _headed(group.names[0], [columns, [row[-1] for row in group.cells]], separator)
    *others, down, across = group.names
    parts = []
    for choice in dict.fromkeys(tuple(row[:-3]) for row in group.cells):
        chosen = [row for row in group.cells if tuple(row[:-3]) == choice]
        cells = {(row[-3], row[-2]): row[-1] for row in chosen}
        table = [["", *columns]]
        table += [
            [head, *(cells.get((head, c), "") for c in columns)]
            for head in dict.fromkeys(row[-3] for row in chosen)
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
    names = constant_names(rows)
    body = [
        [
            r.name,
            *(constant_text(r.constants[n]) if n in r.constants else "" for n in names),
            r.text,
            r.error or str(r.accuracy),
        ]
        for r in rows
    ]
    return _lines([["Property", *names, "Result", "Accuracy"], *body], ",")


def _comments(rows: Sequence[Row]) -> str:
    """RESULT lines for -test, to be copied above the properties of a file."""
    titles = [g.title for g in _groups(rows, ())]
    parts: dict[str, list[str]] = {}
    for r in rows:
        constants = ",".join(f"{n}={constant_text(v)}" for n, v in r.constants.items())
        line = f"// RESULT{f' ({constants})' if constants else ''}: {r.text}\n"
        parts.setdefault(r.name, []).append(line)
    if len(titles) > 1:
        for title, part in zip(titles, parts.values(), strict=True):
            part.append(title + "\n")
    return "\n".join(map("".join, parts.values()))


FORMATS = ("text", "csv", "matrix", "dataframe", "comment", "json")


def render(rows: Sequence[Row], varying: Sequence[str], kinds: Sequence[str]) -> str:
    """The text of some rows.

    Args:
        rows: in any order; those of each property are put together.
        varying: the constants that were given several values: lists and matrices show them.
        kinds: one of `FORMATS`; `matrix` may be combined with `csv`.

    Raises:
        UsageError: a format is unknown.
    """
    unknown = [k for k in kinds if k not in FORMATS]
    if unknown:
        raise UsageError(
            f"unknown format '{unknown[0]}'", hint=f"the formats are {', '.join(FORMATS)}"
        )
    order = list(dict.fromkeys(r.name for r in rows))
    rows = sorted(rows, key=lambda r: order.index(r.name))
    separator = "," if "csv" in kinds else "\t"
    groups = _groups(rows, varying)
    if "matrix" in kinds:
        return _titled(groups, [_matrix(g, separator) for g in groups], separator)
    if "dataframe" in kinds:
        return _dataframe(rows)
    if "comment" in kinds:
        return _comments(rows)
    if "json" in kinds:
        return json_text(rows)
    return _titled(groups, [_list(g, separator) for g in groups], separator)
