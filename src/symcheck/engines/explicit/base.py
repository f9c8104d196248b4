"""The types of values of explicit engines, and an explicit engine as its parts see it."""

from __future__ import annotations

from typing import Protocol

from symcheck.engines.base import EngineOf
from symcheck.engines.capabilities import HasMatrix
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.explicit.rational_values import RationalValues
from symcheck.matrices.rows import Bools

__all__ = ["ExplicitOwner", "Numeric"]

Numeric = ArrayValues | RationalValues
"""Values of one of the two types of number."""


class ExplicitOwner(EngineOf[ArraySet, Numeric], HasMatrix, Protocol):
    """An engine over the rows of all states."""

    @property
    def opponents(self) -> Bools | None:
        """The states in which opponents choose, bool[states]; None: it is no game."""
        ...
