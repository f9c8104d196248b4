"""The errors that symcheck raises, and the places in texts at which they point.

The tree::

    SymcheckError             root of all errors
    ├── InputError            a text of the user is faulty; `diagnostics` says what and where
    │   ├── SyntaxFault       the text does not follow the grammar
    │   ├── NameFault         a name is unknown, repeated or undefined
    │   ├── TypeFault         an expression has the wrong type
    │   └── ModelFault        the model breaks a rule in some state (sums, ranges, rates, deadlocks)
    ├── UsageError            a switch, option, file name or argument is wrong
    │   └── NotInResultError  a result has no such part (NoStrategyError: no strategy)
    ├── UnsupportedError      the request is meaningful, but not supported; the message says what is
    │   └── NeedsRationalsError  doubles do not serve: -exact computes with rational numbers
    ├── NumericalError        a computation did not reach the requested accuracy
    ├── InternalError         a defect of symcheck
    ├── OutputError           what is written does not arrive: a full disk, a closed pipe
    └── ResourceError         the computation was stopped before its end
        ├── MemoryLimitError  by the memory limit, or because memory is exhausted
        ├── TimeLimitError    by the time limit
        └── Interrupted       by the user
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import field
from functools import cached_property, wraps
from itertools import takewhile
from typing import ParamSpec, TypeVar

from symcheck.lazy_dataclass import dataclass

P = ParamSpec("P")
T = TypeVar("T")

__all__ = [
    "NO_SPAN",
    "SMALLER_ENGINES",
    "Diagnostic",
    "InputError",
    "InternalError",
    "Interrupted",
    "MemoryLimitError",
    "ModelFault",
    "NameFault",
    "NeedsRationalsError",
    "NotInResultError",
    "NumericalError",
    "OutputError",
    "ResourceError",
    "Source",
    "Span",
    "SymcheckError",
    "SyntaxFault",
    "TimeLimitError",
    "TypeFault",
    "UnsupportedError",
    "UsageError",
    "converts_memory_error",
    "out_of_memory",
]


@dataclass(frozen=True)
class Source:
    """A named text, such as a model file.

    Attributes:
        shown: the text that the user wrote, if `text` is it with faulty parts blanked out.
        rounded: the pieces, by start and end, that doubles would decide differently (see
            `symcheck.semantics.expressions.rounding_notes`).
    """

    name: str
    text: str = field(repr=False)
    shown: str = field(repr=False, default="")
    rounded: dict[tuple[int, int], Span] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @cached_property
    def _starts(self) -> tuple[int, ...]:
        return (0, *(i + 1 for i, c in enumerate(self.text) if c == "\n"))

    def position(self, offset: int) -> tuple[int, int]:
        """Line and column of a character offset, both counted from 1."""
        line = bisect_right(self._starts, offset)
        return line, offset - self._starts[line - 1] + 1

    def line(self, number: int) -> str:
        """The text of line `number` (from 1), without its end."""
        text, start = self.shown or self.text, self._starts[number - 1]
        end = text.find("\n", start)
        return text[start : end if end >= 0 else len(text)].rstrip("\r")


@dataclass(frozen=True)
class Span:
    """A piece of a source text: characters `start` to `end` (exclusive)."""

    source: Source
    start: int
    end: int

    @property
    def text(self) -> str:
        """The characters themselves."""
        return self.source.text[self.start : self.end]

    def __str__(self) -> str:
        line, column = self.source.position(self.start)
        return f"{self.source.name}:{line}:{column}"

    def __or__(self, other: Span) -> Span:
        """The smallest span that covers both; a span without a source covers nothing."""
        if other.source is not self.source:
            return self if self.source.text else other
        return Span(self.source, min(self.start, other.start), max(self.end, other.end))


_WIDEST = 160
"""The most characters of a line that an excerpt shows, around the mark."""

NO_SPAN = Span(Source("<built>", ""), 0, 0)


@dataclass(frozen=True)
class Diagnostic:
    """One fault of a text.

    Attributes:
        message: what is wrong, in one sentence.
        span: the place in the text.
        code: the kind of fault, a short slug such as 'update-sum'.
        hint: what to write instead, if that is known.
        severity: 'error' or 'warning'.
    """

    message: str
    span: Span = NO_SPAN
    code: str = "input"
    hint: str | None = None
    severity: str = "error"

    @property
    def sentence(self) -> str:
        """The message, with the hint behind it, on one line."""
        return self.message + (f" ({self.hint})" if self.hint else "")

    def __str__(self) -> str:
        if self.span.source is NO_SPAN.source:
            text = f"{self.severity}[{self.code}]: {self.message}"
        else:
            text = f"{self.span}: {self.severity}[{self.code}]: {self.message}\n" + self._excerpt()
        return text + _line("hint", self.hint)

    def _excerpt(self) -> str:
        source = self.span.source
        number, column = source.position(self.span.start)
        line = source.line(number)
        width = max(1, min(self.span.end - self.span.start, len(line) - column + 1))
        if len(line) > _WIDEST:
            first = max(0, min(column - 1 - _WIDEST // 4, len(line) - _WIDEST))
            line, column = line[first : first + _WIDEST], column - first
            width = max(1, min(width, len(line) - column + 1))
        line = "".join(c if c.isprintable() or c == "\t" else "\ufffd" for c in line)
        # Tabs are copied, so that the mark stands under the text whatever the width of a tab is.
        lead = "".join("\t" if c == "\t" else " " for c in line[: column - 1])
        return f"  {number} | {line}\n  {' ' * len(str(number))}   {lead}{'^' * width}"


def _line(kind: str, text: str | None) -> str:
    return f"\n  {kind}: {text}" if text else ""


class SymcheckError(Exception):
    """Root of all errors that symcheck raises intentionally.

    Attributes:
        hint: what to do instead, if that is known.
        note: what else is known, such as which variable grows without bounds.
    """

    def __init__(self, *content: object, hint: str | None = None, note: str | None = None) -> None:
        super().__init__(*content)
        self.hint = hint
        self.note = note

    @property
    def message(self) -> str:
        """What is wrong, without note and hint."""
        return super().__str__()

    def __str__(self) -> str:
        return self.message + _line("note", self.note) + _line("hint", self.hint)

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the line that called symcheck, and the message."""
        import traceback

        package = __file__.removesuffix("errors.py")
        frames = traceback.extract_tb(self.__traceback__)
        outside = takewhile(lambda f: not f.filename.startswith(package), frames)
        lines = [f"line {f.lineno}: {f.line}" for f in outside if f.line][-1:]
        return [*lines, f"{type(self).__name__}: {self}"]


class InputError(SymcheckError):
    """A text of the user is faulty. `diagnostics` lists the faults in the order of the text."""

    def __init__(self, *diagnostics: Diagnostic) -> None:
        super().__init__(*diagnostics)
        self.diagnostics = diagnostics

    @property
    def message(self) -> str:
        """All diagnostics, with their hints."""
        return "\n".join(map(str, self.diagnostics))


class SyntaxFault(InputError):
    """The text does not follow the grammar."""


class NameFault(InputError):
    """A name is unknown, repeated or undefined."""


class TypeFault(InputError):
    """An expression has the wrong type."""


class ModelFault(InputError):
    """The model breaks a rule in some state: probability sums, rates, ranges, deadlocks."""


class UsageError(SymcheckError):
    """A switch, option, file name or argument is wrong."""


class NotInResultError(UsageError, AttributeError):
    """A result has no such part, such as values per state; the message says which results do.

    It is an AttributeError too, so that `hasattr(result, "values")` asks whether there are any.
    """


class NoStrategyError(NotInResultError):
    """A result has no strategy, or several; the message says why, and how to ask for one."""


class UnsupportedError(SymcheckError):
    """The request is meaningful, but not supported; the message says what is."""


class NeedsRationalsError(UnsupportedError):
    """Floating point does not serve, and rational numbers do; the hint says how to have them."""

    def __init__(self, message: str) -> None:
        super().__init__(message, hint="use -exact")


class NumericalError(SymcheckError):
    """A computation did not reach the requested accuracy."""


class InternalError(SymcheckError):
    """A defect of symcheck."""


class OutputError(SymcheckError):
    """What is written does not arrive: the disk is full, or the reader has closed the pipe."""


class ResourceError(SymcheckError):
    """The computation was stopped before its end: by a limit or by the user."""


class MemoryLimitError(ResourceError):
    """The memory limit was reached, or memory is exhausted."""


SMALLER_ENGINES = (
    "the engines -h and -m need less than -s and -ex; -ex -workdir DIR keeps its arrays in files"
)
"""The usual advice when memory is exhausted."""


def out_of_memory(hint: str = SMALLER_ENGINES) -> MemoryLimitError:
    """The error for Python's MemoryError, which arrays raise at the limit of the process."""
    return MemoryLimitError("there is not enough memory", hint=hint)


def converts_memory_error(
    hint: str = SMALLER_ENGINES,
) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A decorator: a MemoryError in the function becomes a MemoryLimitError with a hint."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def converting(*args: P.args, **keywords: P.kwargs) -> T:
            try:
                return function(*args, **keywords)
            except MemoryError as error:
                raise out_of_memory(hint) from error

        return converting

    return decorate


class TimeLimitError(ResourceError):
    """The time limit was reached."""


class Interrupted(ResourceError):
    """The user stopped the run."""
