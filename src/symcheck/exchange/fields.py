"""Text files of numbers, read column by column; what is wrong is pointed at by file, line and column."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault, UsageError
from symcheck.numerics.matrix import Floats, Int64s

__all__ = ["Fields", "read_fields"]


@dataclass(frozen=True, eq=False)
class Fields:
    """The lines of a file, taken apart at blanks, without empty lines and comments; `comments`: those, without `#`.

    numbers: the number of each line in the file, from 0.
    """

    source: Source
    numbers: Sequence[int] = field(repr=False)
    rows: Sequence[Sequence[str]] = field(repr=False)
    comments: Sequence[str] = field(repr=False)

    def fault(self, line: int, message: str, code: str, word: int | None = None, hint: str | None = None) -> NoReturn:
        """Raise SyntaxFault for a line (by its place in `rows`), or for one of its words."""
        if not self.numbers:
            start = end = 0
        else:
            texts = self.source.text.split("\n")
            number = self.numbers[min(line, len(self.numbers) - 1)]
            text = texts[number]
            start = sum(len(t) + 1 for t in texts[:number])
            words = list(re.finditer(r"\S+", text))
            chosen = words[min(word, len(words) - 1)] if word is not None and words else None
            start, end = (start + chosen.start(), start + chosen.end()) if chosen else (start, start + len(text))
        raise SyntaxFault(Diagnostic(message, Span(self.source, start, end), code, hint))

    def header(self, widths: Sequence[int], what: str) -> list[int]:
        """The whole numbers in the first line."""
        if not self.rows:
            self.fault(0, f"the file is empty: its first line should hold {what}", "header")
        first = self.rows[0]
        if len(first) not in widths:
            self.fault(0, f"the first line should hold {what}", "header")
        for i, word in enumerate(first):
            if not word.isdigit():
                self.fault(0, f"'{word}' is not a number of states, choices or transitions", "header", i)
        return [int(word) for word in first]

    def widths(self, allowed: Sequence[int], what: str) -> None:
        """Check the number of words of each line after the first."""
        for i, row in enumerate(self.rows[1:], 1):
            if len(row) not in allowed:
                self.fault(i, f"a line should hold {what}", "fields")

    def integers(self, word: int, limit: int, what: str) -> Int64s:
        """A column of whole numbers from 0 to limit - 1, of the lines after the first."""
        column = [row[word] for row in self.rows[1:]]
        try:
            found = np.array(list(map(int, column)), np.int64)
        except (ValueError, OverflowError):
            self._first(column, _is_integer, word, "'{}' is not a whole number")
        for i in np.flatnonzero((found < 0) | (found >= limit))[:1].tolist():
            self.fault(i + 1, f"{what} {found[i]} does not exist: there are {limit}, numbered from 0", "index", word)
        return found

    def reals(self, word: int) -> Floats:
        """A column of numbers (decimal, or a/b), of the lines after the first."""
        column = [row[word] for row in self.rows[1:]]
        try:
            return np.array(list(map(float, column)), np.float64)
        except ValueError:
            pass
        self._first(column, _is_real, word, "'{}' is not a number")
        return np.array([float(_real(x)) for x in column], np.float64)

    def _first(self, column: Sequence[str], good: Callable[[str], Any], word: int, message: str) -> None:
        for i, text in enumerate(column):
            if not good(text):
                self.fault(i + 1, message.format(text), "number", word)

    def expect(self, count: int, what: str) -> None:
        """Check that as many lines follow the first as it says."""
        if len(self.rows) - 1 != count:
            self.fault(0, f"the first line tells of {count} {what}, and {len(self.rows) - 1} follow", "count", len(self.rows[0]) - 1)


def _is_integer(text: str) -> bool:
    return re.fullmatch(r"-?\d+", text) is not None


def _is_real(text: str) -> bool:
    try:
        _real(text)
    except (ValueError, ZeroDivisionError):
        return False
    return True


def _real(text: str) -> Fraction | float:
    return Fraction(text) if "/" in text else float(text)


def read_fields(path: Path) -> Fields:
    """Read a file. Raises UsageError where it cannot be read."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read '{path}': {getattr(error, 'strerror', None) or error}") from None
    numbers, rows, comments = [], [], []
    for i, line in enumerate(text.split("\n")):
        words = line.split()
        if words and words[0].startswith("#"):
            comments.append(line.strip().lstrip("#").strip())
        elif words:
            numbers.append(i)
            rows.append(words)
    return Fields(Source(str(path), text), numbers, rows, comments)
