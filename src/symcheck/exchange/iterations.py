"""The iterations of numerical methods as files: a table, or a list of objects in JSON."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from io import StringIO
from math import isfinite
from typing import NamedTuple

from symcheck.exchange.text import table_extension
from symcheck.numerics.linear.problem import Progress
from symcheck.semantics.expressions.literals import format_value

__all__ = ["IterationLog", "IterationRow", "iterations_extension", "iterations_text"]


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


def iterations_extension(path: str) -> str:
    """'.csv', also for 'stdout', or '.json'. Raises UsageError."""
    return table_extension(path, "how iterations are written")


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
