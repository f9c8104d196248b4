"""Regions of parameters as files: a table of their boxes, JSON, or a picture."""

from __future__ import annotations

import csv
import json
from collections.abc import Collection
from io import StringIO
from pathlib import Path
from typing import TextIO

from symcheck.check.regions import Regions
from symcheck.errors import UsageError
from symcheck.exchange.text import write_text
from symcheck.tables import optional_package
from symcheck.whole_file import extension_of, write_whole

__all__ = ["regions_extension", "save_regions"]

_TABLES = (".csv", ".json")


def regions_extension(path: str, parameters: Collection[str]) -> str:
    """The extension of a file for regions of some parameters; '.csv' for 'stdout'.

    Raises:
        UsageError: it is unknown, or a picture of more than two parameters is asked for.
        UnsupportedError: pictures need matplotlib, and it is not installed.
    """
    if path == "stdout":
        return ".csv"
    known = (*_TABLES, ".png", ".svg", ".pdf")
    extension = extension_of(path, known, "how regions are written")
    if extension not in _TABLES:
        optional_package("matplotlib", "plot")
        if len(parameters) > 2:
            raise UsageError(
                f"'{path}': a picture has one or two parameters, and there are {len(parameters)}: "
                f"{', '.join(parameters)}",
                hint=".csv and .json list the boxes of any number",
            )
    return extension


def save_regions(regions: Regions, path: str, out: TextIO) -> None:
    """Write regions to a file in the format of its extension, or to `out` if it is 'stdout'.

    `.csv`: a line for each box, with its outcome and the ends of each parameter. `.json`: an object
    with the ranges, the conditions under which the model is defined, and the boxes of each outcome.
    The ends are exact fractions; a box of length 0 is a border.

    Raises:
        UsageError, UnsupportedError: see `regions_extension`; the file cannot be written.
    """
    match regions_extension(path, regions.box):
        case ".csv":
            text = StringIO()
            writer = csv.writer(text, lineterminator="\n")
            ends = [f"{name}_{end}" for name in regions.box for end in ("low", "high")]
            writer.writerow(["outcome", *ends])
            for outcome, boxes in regions.outcomes:
                writer.writerows([outcome, *(e for s in b.values() for e in s)] for b in boxes)
            write_text(path, [text.getvalue()], out)
        case ".json":
            whole = {
                "ranges": regions.box,
                "well_defined": list(map(str, regions.well_defined)),
                "outcomes": [{"outcome": o, "boxes": b} for o, b in regions.outcomes],
            }
            text_of = json.dumps(whole, indent=1, ensure_ascii=False, default=str)
            write_text(path, [text_of, "\n"], out)
        case picture:
            from symcheck.charts import save_chart
            from symcheck.view.parameters import plot_regions

            def write(temporary: Path) -> None:
                save_chart(lambda axes: plot_regions(regions, axes), temporary, picture[1:])

            write_whole(path, write)
