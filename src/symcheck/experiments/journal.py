"""A file of finished rows, from which a stopped experiment goes on."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Any

from symcheck.check.result import Certified, Estimate, Exact, Statistical
from symcheck.errors import UsageError
from symcheck.experiments.rows import Row
from symcheck.operating_system import lock_file

__all__ = ["Journal", "opened"]

_HEAD = b'{"experiment": '
_ACCURACIES = {kind.__name__: kind for kind in (Exact, Certified, Estimate, Statistical)}


class Journal:
    """The rows of a file, by a key that names property and constants.

    The file has a line of JSON that describes the experiment, and one for each row.
    """

    def __init__(self, file: int, rows: dict[str, Row]) -> None:
        self._file = file
        self.rows = rows

    def append(self, rows: Mapping[str, Row]) -> None:
        """Write rows in one piece, and wait until they are on the disk."""
        lines = (json.dumps({"key": key, **_encoded(row)}) + "\n" for key, row in rows.items())
        _write(self._file, "".join(lines))
        self.rows.update(rows)


@contextmanager
def opened(
    path: str | Path, experiment: Mapping[str, str], option: str = "resume"
) -> Iterator[Journal]:
    """The journal of an experiment; an incomplete last line is removed.

    Args:
        path: the file; it is made if there is none.
        experiment: hashes of what its rows depend on, besides the constants.
        option: what named the file, for messages.

    Raises:
        UsageError: the file belongs to another experiment, is no journal, is in use, or cannot be
            written.
    """
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError as error:
        raise UsageError(f"{option}: cannot write '{path}': {error.strerror}") from None
    try:
        try:
            lock_file(file)
        except OSError:
            raise UsageError(f"{option}: '{path}' is in use by another run") from None
        yield Journal(file, _read(file, path, experiment, option))
    finally:
        os.close(file)


def _read(
    file: int, path: str | Path, experiment: Mapping[str, str], option: str
) -> dict[str, Row]:
    with open(file, "rb", closefd=False) as reader:
        *lines, torn = reader.read().split(b"\n")
    foreign = UsageError(
        f"{option}: '{path}' is not a file of finished rows", hint="name a new file"
    )
    if not lines and not _HEAD.startswith(torn[: len(_HEAD)]):
        raise foreign
    rows: dict[str, Row] = {}
    differing: list[str] = []
    if lines:
        try:
            header = json.loads(lines[0])["experiment"]
            differing = [name for name, value in experiment.items() if header.get(name) != value]
            if not differing:
                entries = map(json.loads, lines[1:])
                rows = {entry.pop("key"): _decoded(entry) for entry in entries}
        except (ValueError, KeyError, TypeError, AttributeError):
            raise foreign from None
    if differing:
        raise UsageError(
            f"{option}: '{path}' has the rows of another experiment: another "
            f"{', another '.join(differing)}",
            hint="name a new file, or delete this one",
        )
    if torn:
        os.ftruncate(file, sum(len(line) + 1 for line in lines))
    if not lines:
        _write(file, json.dumps({"experiment": dict(experiment)}) + "\n")
    return rows


def _write(file: int, text: str) -> None:
    data = text.encode()
    while data:
        data = data[os.write(file, data) :]
    os.fsync(file)


def _encoded(row: Row) -> dict[str, Any]:
    entry = asdict(row)
    entry["constants"] = {n: _plain(v) for n, v in row.constants.items()}
    entry["value"] = _plain(row.value)
    if row.accuracy is not None:
        entry["accuracy"] = {"kind": type(row.accuracy).__name__, **asdict(row.accuracy)}
    return entry


def _decoded(entry: dict[str, Any]) -> Row:
    accuracy = entry.pop("accuracy")
    if accuracy is not None:
        accuracy = _ACCURACIES[accuracy.pop("kind")](**accuracy)
    constants = {n: _value(v) for n, v in entry.pop("constants").items()}
    return Row(accuracy=accuracy, constants=constants, value=_value(entry.pop("value")), **entry)


def _plain(value: object) -> object:
    """A value as JSON: rationals and tuples are objects."""
    match value:
        case Fraction():
            return {"fraction": str(value)}
        case tuple():
            return {"pair": [_plain(v) for v in value]}
        case list():
            return [_plain(v) for v in value]
        case _:
            return value


def _value(plain: Any) -> Any:
    match plain:
        case {"fraction": text}:
            return Fraction(text)
        case {"pair": values}:
            return tuple(_value(v) for v in values)
        case list():
            return [_value(v) for v in plain]
        case _:
            return plain
