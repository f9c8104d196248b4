"""Read text files of numbers column by column; errors point at file, line and column."""

from __future__ import annotations

import gc
import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import NoReturn

import numpy as np

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault, UsageError
from symcheck.matrices.rows import Bools, Floats, Int64s
from symcheck.semantics.expressions.evaluate import is_int64
from symcheck.semantics.expressions.literals import LARGEST_WHOLE
from symcheck.whole_file import read_whole

__all__ = [
    "Columns",
    "columns_of",
    "first_true",
    "number_table",
    "read_columns",
    "read_file",
    "read_source",
    "real",
]


@dataclass(frozen=True, eq=False)
class Columns:
    """The lines of a file, split at blanks, without empty lines and comments.

    Attributes:
        source: the text, and its file.
        body: the offset in the text at which the second line begins.
        first: the words of the first line.
        comments: the comments, without `#`.
    """

    source: Source
    body: int = field(repr=False)
    first: Sequence[str] = field(repr=False)
    comments: Sequence[str] = field(repr=False)

    @cached_property
    def _lines(self) -> tuple[list[int], list[list[str]]]:
        """Line numbers and words of all lines. Slow: only for faulty files and unusual formats."""
        numbers, rows = [], []
        # The collector would search millions of small lists for cycles, which takes longest.
        collecting = gc.isenabled()
        gc.disable()
        try:
            for i, line in enumerate(self.source.text.split("\n")):
                words = (line.partition("#")[0] if "#" in line else line).split()
                if words:
                    numbers.append(i)
                    rows.append(words)
        finally:
            if collecting:
                gc.enable()
        return numbers, rows

    @property
    def numbers(self) -> list[int]:
        """The number of each line in the file, from 0."""
        return self._lines[0]

    @property
    def rows(self) -> list[list[str]]:
        """The words of each line."""
        return self._lines[1]

    @cached_property
    def table(self) -> Floats | None:
        """The lines after the first, float64[lines, words]; None as in `number_table`."""
        return number_table(self.source.text[self.body :])

    @property
    def count(self) -> int:
        """Number of lines after the first."""
        return len(self.rows) - 1 if self.table is None else len(self.table)

    def fault(
        self, line: int, message: str, code: str, word: int | None = None, hint: str | None = None
    ) -> NoReturn:
        """Raise SyntaxFault for a line (its index in `rows`), or for one of its words."""
        if not self.numbers:
            start = end = 0
        else:
            texts = self.source.text.split("\n")
            number = self.numbers[min(line, len(self.numbers) - 1)]
            text = texts[number]
            start = sum(len(t) + 1 for t in texts[:number])
            words = list(re.finditer(r"\S+", text))
            chosen = words[min(word, len(words) - 1)] if word is not None and words else None
            start, end = (
                (start + chosen.start(), start + chosen.end())
                if chosen
                else (start, start + len(text))
            )
        raise SyntaxFault(Diagnostic(message, Span(self.source, start, end), code, hint))

    def header(self, widths: Sequence[int], what: str) -> list[int]:
        """The integers in the first line."""
        if not self.first:
            self.fault(0, f"the file is empty: its first line should hold {what}", "header")
        first = self.first
        if len(first) not in widths:
            self.fault(0, f"the first line should hold {what}", "header")
        for i, word in enumerate(first):
            if not word.isdigit():
                self.fault(
                    0, f"'{word}' is not a number of states, choices or transitions", "header", i
                )
        return [int(word) for word in first]

    def widths(self, allowed: Sequence[int], what: str) -> None:
        """Check the number of words of each line after the first."""
        if self.table is not None and self.table.shape[1] in allowed:
            return
        for i, row in enumerate(self.rows[1:], 1):
            if len(row) not in allowed:
                self.fault(i, f"a line should hold {what}", "fields")

    def integers(self, word: int, limit: int, what: str) -> Int64s:
        """A column of the lines after the first: integers from 0 to limit - 1, int64[lines]."""
        numbers = self._integers(word)
        for i in first_true((numbers < 0) | (numbers >= limit)):
            self.fault(
                i + 1,
                f"{what} {numbers[i]} does not exist: there are {limit}, numbered from 0",
                "index",
                word,
            )
        return numbers

    def _integers(self, word: int) -> Int64s:
        if self.table is not None:
            plain = self.table[:, word]
            if np.all(plain == np.floor(plain)):
                return plain.astype(np.int64)
        column = [row[word] for row in self.rows[1:]]
        try:
            return np.array(list(map(int, column)), np.int64)
        except ValueError:
            self._first(column, _is_integer, word, "'{}' is not an integer")
            raise
        except OverflowError:
            self._first(column, _has_64_bits, word, "'{}' has more than 64 bits")
            raise

    def reals(self, word: int) -> Floats:
        """A column of the lines after the first: decimals or fractions a/b, float64[lines]."""
        if self.table is not None:
            return np.ascontiguousarray(self.table[:, word])
        column = [row[word] for row in self.rows[1:]]
        try:
            return np.array(list(map(float, column)), np.float64)
        except ValueError:
            pass
        return np.array([self.real(i, x, word) for i, x in enumerate(column, 1)], np.float64)

    def real(self, line: int, text: str, word: int) -> float:
        """A number in a word of a line (its index in `rows`)."""
        try:
            return real(text)
        except (ValueError, ArithmeticError):
            self.fault(line, f"'{text}' is not a number", "number", word)

    def _first(
        self, column: Sequence[str], good: Callable[[str], bool], word: int, message: str
    ) -> None:
        for i, text in enumerate(column):
            if not good(text):
                self.fault(i + 1, message.format(text), "number", word)

    def expect(self, count: int, what: str) -> None:
        """Check that as many lines follow the first line as it announces."""
        if self.count != count:
            self.fault(
                0,
                f"the first line announces {count} {what}, but {self.count} follow",
                "count",
                len(self.first) - 1,
            )


def first_true(faulty: Bools) -> list[int]:
    """The first index at which something is faulty, or none: for the error that names it."""
    found: list[int] = np.flatnonzero(faulty)[:1].tolist()
    return found


def _is_integer(text: str) -> bool:
    return re.fullmatch(r"-?\d+", text) is not None


def _has_64_bits(text: str) -> bool:
    return is_int64(int(text))


def real(text: str) -> float:
    """A number or a fraction. Raises ValueError, ArithmeticError."""
    return float(Fraction(text) if "/" in text else text)


def read_file(path: Path) -> str:
    """The text of a file. Raises UsageError if it cannot be read or is not UTF-8 text."""
    try:
        return read_whole(path).decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise UsageError(f"cannot read '{path}': not a UTF-8 text file") from None


def read_source(path: Path) -> Source:
    """The text of a file, with its name. Raises UsageError as `read_file`."""
    return Source(str(path), read_file(path))


def read_columns(path: Path) -> Columns:
    """Read a file. Raises UsageError as `read_file`."""
    return columns_of(read_source(path))


def columns_of(source: Source) -> Columns:
    """The lines of a text."""
    text = source.text
    comments: list[str] = []
    first: list[str] = []
    start = 0
    while start < len(text) and not first:
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        words = text[start:end].split()
        if words and words[0].startswith("#"):
            comments.append(text[start:end].strip().lstrip("#").strip())
        else:
            first = words
        start = end + 1
    return Columns(source, start, first, comments)


def number_table(text: str) -> Floats | None:
    """Lines of numbers as float64[lines, words].

    None if a word is not a number, if lines differ in length, or if a number exceeds 2**53.
    """
    if not text.strip():
        return None
    try:
        table = np.loadtxt(io.StringIO(text), dtype=np.float64, comments="#", ndmin=2)
    except ValueError:
        return None
    return table if len(table) and bool(np.all(np.abs(table) < LARGEST_WHOLE)) else None
