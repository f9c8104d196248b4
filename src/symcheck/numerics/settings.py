"""What the numerical methods need to be told; the options of a check fit this protocol."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

__all__ = ["ROUNDING", "Accuracy", "Settings"]

ROUNDING = 1e-12
"""Relative error that is allowed for in a value that is 'exact up to rounding', wherever something is concluded from it."""


class Settings(Protocol):
    """Width wanted (relative, or absolute), whether it must be proved, the method ('auto' or a name), and a limit."""

    @property
    def method(self) -> str:
        """'auto' or a name in METHODS."""
        ...

    @property
    def epsilon(self) -> float:
        """The width wanted."""
        ...

    @property
    def relative(self) -> bool:
        """Whether the width is relative to the value."""
        ...

    @property
    def certify(self) -> bool:
        """Whether it must be proved."""
        ...

    @property
    def max_iterations(self) -> int:
        """A limit on sweeps, products or policies."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Settings for use without a check."""

    method: str = "auto"
    epsilon: float = 1e-6
    relative: bool = True
    certify: bool = True
    max_iterations: int = 1_000_000
