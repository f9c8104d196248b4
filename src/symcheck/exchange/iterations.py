"""The iterations of numerical methods as files: a table, or a list of objects in JSON."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from io import StringIO
from math import isfinite
from pathlib import Path
from typing import NamedTuple

from symcheck.errors import UsageError
from symcheck.numerics.linear.problem import Progress
from symcheck.semantics.expressions.literals import format_value

__all__ = ["EXTENSIONS", "IterationLog", "IterationRow", "check_iterations_file", "iterations_text"]

EXTENSIONS = (".csv", ".json")


class IterationRow(NamedTuple):
    """One iteration.

    Attributes:
        run: the computations of a property are numbered from 1: a method may solve a part of the
            states after the other.
        method: its name.
        iteration: as the method counts, which may tell of every tenth iteration only.
        width: the distance of the bounds, or the last change of an estimate.
        states: the number of unknowns.
    """

    run: int
    method: str
    iteration: int
    width: float
    states: int


class IterationLog:
    """An observer of numerical methods that keeps a row of each iteration, and no vectors."""

    def __init__(self) -> None:
        self.rows: list[IterationRow] = []

    def __call__(self, progress: Progress) -> None:
        """Take note of an iteration."""
        run = 1
        if self.rows:
            last = self.rows[-1]
            same = (last.method, last.states) == (progress.method, progress.states)
            run = last.run + (not same or progress.iteration <= last.iteration)
        self.rows.append(
            IterationRow(
                run, progress.method, progress.iteration, float(progress.width), progress.states
            )
        )


def check_iterations_file(path: str) -> str:
    """The extension of a file of iterations; that of 'stdout' is '.csv'.

    Raises:
        UsageError: it is unknown, or the folder does not exist.
    """
    extension = ".csv" if path == "stdout" else Path(path).suffix.lower()
    if extension not in EXTENSIONS:
        raise UsageError(
            f"'{path}': the extension says how iterations are written, "
            f"and it is none of {', '.join(EXTENSIONS)}"
        )
    if not Path(path).parent.is_dir():
        raise UsageError(f"there is no folder '{Path(path).parent}'")
    return extension


def iterations_text(rows: Sequence[IterationRow], extension: str) -> str:
    """The text of a file; an infinite width is the text 'Infinity'."""
    if extension == ".csv":
        out = StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(IterationRow._fields)
        writer.writerows((*r[:3], format_value(r.width), r.states) for r in rows)
        return out.getvalue()
    objects = []
    for row in rows:
        plain: dict[str, object] = row._asdict()
        if not isfinite(row.width):
            plain["width"] = format_value(row.width)
        objects.append(json.dumps(plain))
    return "[" + ",\n ".join(objects) + "]\n"
