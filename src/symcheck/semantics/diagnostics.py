"""Collection of diagnostics, which are raised together in the order of the text."""

from __future__ import annotations

from collections.abc import Iterable

from symcheck.errors import Diagnostic, InputError, NameFault, Span, TypeFault

__all__ = ["DiagnosticCollector", "suggest"]


class DiagnosticCollector:
    """Collects diagnostics.

    The same message at the same place counts once, because a formula may be used many times.
    """

    def __init__(self) -> None:
        self._diagnostics: dict[Diagnostic, type[InputError]] = {}

    def __bool__(self) -> bool:
        return bool(self._diagnostics)

    @property
    def codes(self) -> frozenset[str]:
        """The codes of the collected diagnostics."""
        return frozenset(d.code for d in self._diagnostics)

    def name(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        """Add a diagnostic about an unknown, duplicate or undefined name."""
        self.absorb(NameFault(Diagnostic(message, span, code, hint)))

    def type(self, message: str, span: Span, hint: str | None = None, code: str = "type") -> None:
        """Add a diagnostic about an expression of the wrong type."""
        self.absorb(TypeFault(Diagnostic(message, span, code, hint)))

    def input(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        """Add a diagnostic about anything else."""
        self.absorb(InputError(Diagnostic(message, span, code, hint)))

    def absorb(self, fault: InputError) -> None:
        """Add the diagnostics of an error that was raised."""
        for diagnostic in fault.diagnostics:
            self._diagnostics.setdefault(diagnostic, type(fault))

    def fault(self) -> InputError | None:
        """One error with all diagnostics; None if there are none.

        It is a NameFault or TypeFault, for example, if all of them are, otherwise an InputError.
        """
        if not self._diagnostics:
            return None
        kinds = set(self._diagnostics.values())
        kind = kinds.pop() if len(kinds) == 1 else InputError
        result = sorted(self._diagnostics, key=lambda d: (d.span.source.name, d.span.start))
        return kind(*result)

    def raise_all(self) -> None:
        """Raise all diagnostics as one error, if there are any."""
        if fault := self.fault():
            raise fault


def suggest(name: str, known: Iterable[str]) -> str | None:
    """The hint 'did you mean …?' if a known name is similar to `name`, otherwise None."""
    import difflib

    names = sorted(set(known))
    close = [k for k in names if k.casefold() == name.casefold()] or difflib.get_close_matches(
        name, names, n=1, cutoff=0.6
    )
    return f"did you mean {close[0]}?" if close else None
