"""Collect what is wrong with a text, and raise it all at once in the order of the text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal as Choice

from symcheck.errors import Diagnostic, InputError, NameFault, Span, TypeFault

__all__ = ["Report", "suggest"]

Kind = Choice["name", "type", "input"]
_CLASSES: dict[str, type[InputError]] = {"name": NameFault, "type": TypeFault, "input": InputError}


class Report:
    """Diagnostics found so far. The same message at the same place counts once (a formula may be used many times)."""

    def __init__(self) -> None:
        self._found: dict[Diagnostic, Kind] = {}

    def __bool__(self) -> bool:
        return bool(self._found)

    @property
    def codes(self) -> frozenset[str]:
        """The kinds of what was found."""
        return frozenset(d.code for d in self._found)

    def add(self, kind: Kind, code: str, message: str, span: Span, hint: str | None = None) -> None:
        """Note one thing that is wrong."""
        self._found.setdefault(Diagnostic(message, span, code, hint), kind)

    def name(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        """Note an unknown, repeated or undefined name."""
        self.add("name", code, message, span, hint)

    def type(self, message: str, span: Span, hint: str | None = None, code: str = "type") -> None:
        """Note an expression of the wrong type."""
        self.add("type", code, message, span, hint)

    def input(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        """Note anything else."""
        self.add("input", code, message, span, hint)

    def absorb(self, fault: InputError) -> None:
        """Note the diagnostics of a fault that was raised."""
        kind: Kind = (
            "name"
            if isinstance(fault, NameFault)
            else "type"
            if isinstance(fault, TypeFault)
            else "input"
        )
        for diagnostic in fault.diagnostics:
            self._found.setdefault(diagnostic, kind)

    def fault(self) -> InputError | None:
        """All that was found as one error, None if nothing was: NameFault or TypeFault where all are of that kind."""
        if not self._found:
            return None
        kinds = set(self._found.values())
        found = sorted(self._found, key=lambda d: (d.span.source.name, d.span.start))
        return (_CLASSES[kinds.pop()] if len(kinds) == 1 else InputError)(*found)

    def raise_found(self) -> None:
        """Raise what was found, if anything was."""
        if fault := self.fault():
            raise fault


def suggest(name: str, known: Iterable[str]) -> str | None:
    """The hint 'did you mean …?' where a known name is close to `name`."""
    import difflib

    names = sorted(set(known))
    close = [k for k in names if k.casefold() == name.casefold()] or difflib.get_close_matches(
        name, names, n=1, cutoff=0.6
    )
    return f"did you mean {close[0]}?" if close else None
