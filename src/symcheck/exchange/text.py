"""Write large texts in chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TextIO

import numpy as np

from symcheck.matrices.numbers import Numbers
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
        return str(value)
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
    if values.dtype == object:
        return [number_text(v if isinstance(v, Fraction) else float(v), precision) for v in values]
    distinct, index = np.unique(values, return_inverse=True)
    texts = np.array([number_text(v, precision) for v in distinct.tolist()], dtype=object)
    chosen: list[str] = texts[index].tolist() if len(distinct) else []
    return chosen


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
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        parts = [_part(c, start, stop, precision) for c in columns]
        yield "".join(map(line.__mod__, zip(*parts, strict=True)))


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
