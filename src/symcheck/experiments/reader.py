"""Read results that `Experiment.save` and -exportresults have written."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from io import StringIO
from pathlib import Path

from symcheck.check.result import (
    UNIFORM,
    Accuracy,
    Answer,
    Certified,
    Estimate,
    Exact,
    Number,
    Statistical,
)
from symcheck.constant_values import ConstantValue, typed_value
from symcheck.errors import UsageError
from symcheck.experiments.rows import Row, records
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.semantics.expressions.literals import to_float
from symcheck.whole_file import read_whole, uncompressed_name

__all__ = ["read_rows"]

Record = Mapping[str, object]
"""The cells of a row by column: JSON values, or texts."""


def _other_form(message: str) -> UsageError:
    return UsageError(
        message,
        hint="-exportresults FILE.csv, FILE.json and FILE.csv:dataframe write results that can "
        "be read",
    )


_COLUMNS = tuple(records([Row("", {})])[0])
"""The columns of a table besides its constants."""

_ROUNDED_UP = 1.05
"""The printed error of a value has two digits, and may be smaller by a twentieth of itself."""

_STATISTICAL = re.compile(
    r"in \[(.+), (.+)\] with probability (?:about )?([^ ]+), (\d+) samples"
    r"(?:, by (.+?))?(, an approximation)?"
)


def read_rows(path: str | Path) -> list[Row]:
    """The rows in a file: .json, or a table .csv (also PRISM's data frame).

    A file does not have the texts of named properties. A data frame has no bounds: those of a
    certified value follow from its printed error, and without a column 'Accuracy' (PRISM writes
    none) a value is an estimate.

    Raises:
        UsageError: the file cannot be read, or has another form; the message names the line.
    """
    extension = Path(uncompressed_name(path)[0]).suffix.lower()
    if extension not in (".csv", ".json", ".txt", ""):
        raise _other_form(f"{path}: results are read from .csv and .json")
    try:
        text = read_whole(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise UsageError(f"cannot read {path}: not a UTF-8 text file") from None
    table = _json_records(text, path) if extension == ".json" else _csv_records(text, path)
    rows = []
    for line, record in table:
        try:
            rows.append(_row(record))
        except ValueError as error:
            raise UsageError(f"{path}:{line}: {error}") from None
    return rows


def _json_records(text: str, path: str | Path) -> Iterator[tuple[int, Record]]:
    """The objects of a list, each with the line in which it begins."""
    try:
        whole = json.loads(text)
    except json.JSONDecodeError as error:
        raise _other_form(f"{path}:{error.lineno}:{error.colno}: {error.msg}") from None
    if not isinstance(whole, list) or not all(isinstance(item, dict) for item in whole):
        raise _other_form(f"{path}:1: expected a list of objects")
    line, start, end = 1, 0, 0
    decode = json.JSONDecoder().raw_decode
    for _ in whole:
        before, start = start, text.index("{", end)
        line += text.count("\n", before, start)
        record, end = decode(text, start)
        missing = [name for name in ("property", "value") if name not in record]
        if missing:
            raise _other_form(f"{path}:{line}: an object without '{missing[0]}'")
        yield line, record


def _csv_records(text: str, path: str | Path) -> Iterator[tuple[int, Record]]:
    """The lines below the header, by column."""
    reader = csv.reader(StringIO(text, newline=""))
    try:
        header = _header(next(reader, []))
    except ValueError as error:
        raise _other_form(f"{path}:1: {error}") from None
    for cells in reader:
        if not cells:
            continue
        if len(cells) != len(header):
            raise UsageError(
                f"{path}:{reader.line_num}: expected {len(header)} columns, as in the first line, "
                f"and there are {len(cells)}"
            )
        yield reader.line_num, dict(zip(header, cells, strict=True))


def _header(names: list[str]) -> list[str]:
    """The columns of a table; those of PRISM's data frame get the names of the others."""
    if names[:1] == ["Property"] and "Result" in names:
        frame = {"Property": "property", "Result": "value", "Accuracy": "accuracy"}
        names = [frame.get(n, f"constant {n}") for n in names]
    if "property" not in names or "value" not in names:
        raise ValueError("expected a table with the columns property and value")
    if len(set(names)) < len(names):
        raise ValueError("two columns have the same name")
    return names


def _row(record: Record) -> Row:
    """Raises ValueError."""
    constants = {
        name.removeprefix("constant "): _constant(cell)
        for name, cell in record.items()
        if name not in _COLUMNS and cell not in (None, "")
    }
    name, shown = str(record["property"]), record["value"]
    said = str(record.get("accuracy") or "")
    error = str(record.get("error") or "") or None
    if isinstance(shown, str) and shown.startswith("Error"):  # in a data frame
        error = said or shown.partition(":")[2].strip() or shown
    value, accuracy = None, None
    if error is None:
        value = _value(shown)
        lower, upper = (_number(record.get(n), n) for n in ("lower", "upper"))
        accuracy = _accuracy(said, value, lower, upper)
    return Row(
        name,
        constants,
        value,
        accuracy,
        error,
        int(_number(record.get("states"), "states") or 0),
        int(_number(record.get("transitions"), "transitions") or 0),
        _number(record.get("build_seconds"), "build_seconds") or 0.0,
        _number(record.get("seconds"), "seconds") or 0.0,
    )


def _constant(cell: object) -> ConstantValue:
    if isinstance(cell, bool | int | float | str):
        return typed_value(cell)
    raise ValueError(f"'{cell}' is no value of a constant")


def _number(cell: object, column: str) -> float | None:
    value = typed_value(cell) if isinstance(cell, str) else cell
    match value:
        case None | "":
            return None
        case int() | float() | Fraction():
            return to_float(value)
        case _:
            raise ValueError(f"'{cell}' in the column {column} is no number")


def _value(cell: object) -> Answer:
    """The value in a cell: `true`, a number, `[low,high]`, or a list of points."""
    match cell:
        case None | "" | "none":
            return None
        case str() if cell[0] == "[":
            inner = cell[1:-1]
            points = re.findall(r"[\[(]([^\[\]()]*)[\])]", inner)
            if points or not inner:
                return [tuple(map(_of_value, p.split(","))) for p in points]
            return _pair(inner.split(","))
        case list() if all(isinstance(item, list) for item in cell):
            return [tuple(map(_of_value, point)) for point in cell]
        case list():
            return _pair(cell)
        case bool() | "true" | "false":
            return cell in (True, "true")
        case _:
            return _of_value(cell)


def _pair(cells: list[object] | list[str]) -> tuple[Number, Number]:
    if len(cells) != 2:
        raise ValueError(f"{len(cells)} numbers in brackets are no range of values")
    return _of_value(cells[0]), _of_value(cells[1])


def _of_value(cell: object) -> Number:
    value = typed_value(cell) if isinstance(cell, str) else cell
    if isinstance(value, bool) or not isinstance(value, Number):
        raise ValueError(f"'{cell}' is no value of a property")
    return value


def _accuracy(said: str, value: Answer, lower: float | None, upper: float | None) -> Accuracy:
    """The accuracy that a text says, of a value with bounds (None: without)."""
    if said in ("exact", "exact up to rounding"):
        return Exact() if said == "exact" else Exact(True, lower, upper)
    if said in ("estimate", ""):
        return Estimate()
    interval = said.removeprefix(UNIFORM)
    if match := _STATISTICAL.fullmatch(interval):
        low, high, confidence = map(float, match.groups()[:3])
        low, high = low if lower is None else lower, high if upper is None else upper
        bound, approximate, uniform = match[5] or "", match[6] is not None, interval != said
        return Statistical(confidence, low, high, int(match[4]), bound, approximate, uniform)
    start, plus, printed = said.partition("+/- ")
    if start != "certified: " or not plus:
        raise ValueError(f"'{said}' is no accuracy of a value")
    epsilon = float(printed)
    if value is None or isinstance(value, bool | list | RationalFunction):
        return Certified(-epsilon, epsilon)
    if isinstance(value, tuple):  # the bounds of its numbers follow from the width alone
        epsilon = to_float(value[0]) - lower if lower is not None else epsilon * _ROUNDED_UP
        return Certified(-epsilon, epsilon)
    if lower is not None and upper is not None:
        return Certified(lower, upper)
    middle, epsilon = to_float(value), epsilon * _ROUNDED_UP
    return Certified(middle - epsilon, middle + epsilon)
