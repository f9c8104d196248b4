"""Write large texts in chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TextIO

import numpy as np

from symcheck.kernels.arrays import Int32s, Int64s
from symcheck.kernels.tables.text_lines import join_lines
from symcheck.matrices.numbers import Numbers, shared
from symcheck.semantics.expressions.literals import format_value
from symcheck.whole_file import extension_of, open_for_text, write_whole

__all__ = [
    "CHUNK",
    "FULL_PRECISION",
    "lines",
    "number_text",
    "number_texts",
    "table_extension",
    "write_text",
]

CHUNK = 1 << 16
"""Number of lines per chunk."""

FULL_PRECISION = 17
"""Digits that identify every double. From here on, the shortest text that reads back is written."""

Column = Numbers | Sequence[object] | Callable[[int, int], Sequence[object]]


def number_text(value: float | Fraction, precision: int = FULL_PRECISION) -> str:
    """A number with at most `precision` digits; an integer without a point, a rational as `a/b`."""
    if isinstance(value, Fraction):
        return format_value(value)
    if np.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    if precision < FULL_PRECISION:
        return f"{value:.{precision}g}"
    return repr(float(value)).removesuffix(".0")


def number_texts(values: Numbers, precision: int = FULL_PRECISION) -> list[str]:
    """`number_text` of each value (float64[n] or objects). Most models have few distinct values.

    Complex numbers stand for intervals, with the lower end as real part.
    """
    if values.dtype.kind == "c":
        ends = number_texts(values.real, precision), number_texts(values.imag, precision)
        return [f"[{low},{high}]" for low, high in zip(*ends, strict=True)]
    texts, index = _distinct_texts(values, precision)
    chosen: list[str] = np.array(texts, dtype=object)[index].tolist()
    return chosen


def _distinct_texts(values: Numbers, precision: int) -> tuple[list[str], Int32s]:
    """The texts of the distinct numbers, and the place of that of each number among them."""
    if values.dtype == object:
        objects, index = shared(values)
        distinct = [v if isinstance(v, Fraction) else float(v) for v in objects]
    else:
        found = np.unique(values)
        distinct, index = found.tolist(), np.searchsorted(found, values).astype(np.int32)
    return [number_text(v, precision) for v in distinct], index


def lines(
    template: str, count: int, *columns: Column, precision: int = FULL_PRECISION
) -> Iterator[str]:
    """Format `count` lines from columns, in chunks.

    Args:
        template: a %-template for a line, without the line end.
        count: number of lines.
        columns: per placeholder an array (doubles are written with `precision` digits), a list, or
            a function of a range of line numbers.
        precision: significant digits.
    """
    line = template + "\n"
    arrays = [c for c in columns if isinstance(c, np.ndarray) and c.dtype.kind in "iufO"]
    compiled = len(arrays) == len(columns) and {*template.split(" ")} <= {"%d", "%s"}
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        if compiled:
            yield join_lines([_cells(a[start:stop], precision) for a in arrays], stop - start)
            continue
        parts = [_part(c, start, stop, precision) for c in columns]
        yield "".join(map(line.__mod__, zip(*parts, strict=True)))


def _cells(piece: Numbers, precision: int) -> Int64s | tuple[list[str], Int32s]:
    """A piece of a column as the compiled code reads it."""
    whole = piece.dtype.kind in "iu"
    return piece.astype(np.int64) if whole else _distinct_texts(piece, precision)


def _part(column: Column, start: int, stop: int, precision: int) -> Sequence[object]:
    if callable(column):
        return column(start, stop)
    piece = column[start:stop]
    if isinstance(piece, np.ndarray):
        return number_texts(piece, precision) if piece.dtype.kind in "fOc" else piece.tolist()
    return piece


def table_extension(path: str, meaning: str) -> str:
    """'.csv', also for 'stdout', or '.json'. Raises UsageError as `extension_of`."""
    return ".csv" if path == "stdout" else extension_of(path, (".csv", ".json"), meaning)


def write_text(target: str, chunks: Iterable[str], out: TextIO) -> None:
    """Write to a file, or to `out` if the target is 'stdout'. The file appears when it is complete.

    A name that ends in .gz or .xz names a compressed file.

    Raises:
        UsageError: the file cannot be written.
    """
    if target == "stdout":
        out.writelines(chunks)
        return

    def write(temporary: Path) -> None:
        with open_for_text(temporary, target) as file:
            file.writelines(chunks)

    write_whole(target, write)
