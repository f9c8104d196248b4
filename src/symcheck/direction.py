"""Whether a value is minimised or maximised over the strategies of a model."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["Direction"]


class Direction(StrEnum):
    """Minimise or maximise over strategies. Chains have no strategies: their direction is None.

    >>> Direction.MIN.dual
    <Direction.MAX: 'max'>
    """

    MIN = "min"
    MAX = "max"

    @property
    def dual(self) -> Direction:
        """The direction of the complement: the minimum of p is 1 minus the maximum of 1 - p."""
        return Direction.MAX if self is Direction.MIN else Direction.MIN
