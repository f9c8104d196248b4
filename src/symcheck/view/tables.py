"""Tables of results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from symcheck.check.result import show_value
from symcheck.errors import UsageError
from symcheck.tables import Table

if TYPE_CHECKING:
    from symcheck.check.result import Result

__all__ = ["Table", "results"]


def results(answers: Iterable[tuple[object, Result]]) -> Table:
    """A table of results.

    Args:
        answers: pairs of a property, or of its text, and its result: such as
            `model.check_all(…)` gives.

    Raises:
        UsageError: it is a single result.
    """
    if not isinstance(answers, Iterable):
        expected = "results takes the pairs of model.check_all(…)"
        raise UsageError(f"{expected}, not an object of the type {type(answers).__name__}")
    return Table.of(
        ("property", "value", "accuracy"),
        [(name, show_value(r.value), r.accuracy) for name, r in answers],
    )
