"""JSON values that know their places in the text."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from fractions import Fraction
from typing import NoReturn

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault, UnsupportedError

__all__ = ["Json", "parse_json"]

_SPACE = re.compile(r"[ \t\r\n]*")
_LARGEST_EXPONENT = 400
_TYPO = 0.7
"""The least similarity of a word to the one that it is taken for."""

Value = bool | int | Fraction | str | list["Json"] | Mapping[str, "Json"] | None


@dataclass(frozen=True, slots=True)
class Json:
    """A value: null, a boolean, a number (kept exactly), a string, a list or an object."""

    value: Value
    span: Span

    def fault(self, message: str, hint: str | None = None) -> SyntaxFault:
        """The error for a fault at this place."""
        return SyntaxFault(Diagnostic(message, self.span, "jani", hint))

    def unsupported(self, message: str, hint: str | None = None) -> UnsupportedError:
        """The error for what is valid JANI, but not supported."""
        return UnsupportedError(str(Diagnostic(message, self.span, "unsupported", hint)))

    @property
    def members(self) -> Mapping[str, Json]:
        """The members of an object. Raises SyntaxFault if it is none."""
        if not isinstance(self.value, Mapping):
            raise self.fault("an object { … } is expected here")
        return self.value

    @property
    def items(self) -> Sequence[Json]:
        """The items of a list. Raises SyntaxFault if it is none."""
        if not isinstance(self.value, list):
            raise self.fault("a list [ … ] is expected here")
        return self.value

    @property
    def text(self) -> str:
        """The characters of a string. Raises SyntaxFault if it is none."""
        if not isinstance(self.value, str):
            raise self.fault('a string "…" is expected here')
        return self.value

    @property
    def truth(self) -> bool:
        """A boolean. Raises SyntaxFault if it is none."""
        if not isinstance(self.value, bool):
            raise self.fault("true or false is expected here")
        return self.value

    def get(self, key: str) -> Json | None:
        """A member of an object, or None if there is none, or if it is null."""
        member = self.members.get(key)
        return None if member is None or member.value is None else member

    def __getitem__(self, key: str) -> Json:
        member = self.get(key)
        if member is None:
            raise self.fault(f'this object needs a member "{key}"')
        return member

    def each(self, key: str) -> Sequence[Json]:
        """The items of the list that is a member of an object; none without the member."""
        member = self.get(key)
        return () if member is None else member.items

    def nodes(self) -> Iterator[Json]:
        """The value and all values within it."""
        yield self
        parts = self.value if isinstance(self.value, list) else ()
        for part in self.members.values() if isinstance(self.value, Mapping) else parts:
            yield from part.nodes()

    def check_members(self, known: Sequence[str]) -> None:
        """Refuse a member that resembles a known one; other members belong to other tools.

        Raises SyntaxFault.
        """
        for key in self.members.keys() - set(known):
            near = get_close_matches(key, known, 1, _TYPO)
            if near and near[0] not in self.members:
                raise self.members[key].fault(
                    f'"{key}" is no member of this object', f'did you mean "{near[0]}"?'
                )

    def flag(self, key: str) -> bool:
        """The truth of a member of an object; false without the member."""
        member = self.get(key)
        return member is not None and member.truth


def parse_json(source: Source) -> Json:
    """Parse a text.

    Raises:
        SyntaxFault: the text is no JSON value.
    """
    try:
        json.loads(source.text, parse_float=_no_number, parse_int=_no_number)
    except json.JSONDecodeError as error:
        span = Span(source, error.pos, error.pos + 1)
        raise SyntaxFault(Diagnostic(f"this is no JSON: {error.msg}", span, "json")) from None
    reader = _Reader(source)
    return reader.value(reader.skip(0))[0]


def _no_number(_: str) -> None:
    """The first pass looks at the syntax only."""


def _real(text: str) -> Fraction:
    _, _, exponent = text.lower().partition("e")
    if abs(int(exponent or 0)) > _LARGEST_EXPONENT:
        raise ValueError("this number is out of range")
    return Fraction(text)


def _constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number of JSON")


class _Reader:
    """Reads lists and objects itself, to know their places; json reads the rest."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.text = source.text
        self.decode = json.JSONDecoder(parse_float=_real, parse_constant=_constant).raw_decode

    def value(self, start: int) -> tuple[Json, int]:
        """The value that starts at a position, and the position behind it."""
        content: Value
        match self.text[start]:
            case "{":
                content, end = self._object(start)
            case "[":
                entries, end = [], self.skip(start + 1)
                while self.text[end] != "]":
                    entry, end = self.value(end)
                    entries.append(entry)
                    end = self._behind_comma(end)
                content, end = entries, end + 1
            case _:
                try:
                    content, end = self.decode(self.text, start)
                except ValueError as error:
                    end = len(self.text)
                    span = Span(self.source, start, start + 1)
                    raise SyntaxFault(Diagnostic(str(error), span, "number")) from None
        return Json(content, Span(self.source, start, end)), end

    def _object(self, start: int) -> tuple[dict[str, Json], int]:
        members: dict[str, Json] = {}
        end = self.skip(start + 1)
        while self.text[end] != "}":
            at = end
            key, end = self.decode(self.text, at)
            if key in members:
                span = Span(self.source, at, end)
                raise SyntaxFault(Diagnostic(f'"{key}" occurs twice in an object', span, "json"))
            end = self.skip(end) + 1  # behind the colon
            members[key], end = self.value(self.skip(end))
            end = self._behind_comma(end)
        return members, end + 1

    def skip(self, at: int) -> int:
        """The position behind blanks and line ends."""
        space = _SPACE.match(self.text, at)
        return at if space is None else space.end()

    def _behind_comma(self, at: int) -> int:
        at = self.skip(at)
        return self.skip(at + 1) if self.text[at] == "," else at
