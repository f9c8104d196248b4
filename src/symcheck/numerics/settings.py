"""The settings of the numerical methods; the options of a check satisfy this protocol."""

from __future__ import annotations

from typing import Protocol

from symcheck.lazy_dataclass import dataclass

__all__ = ["ROUNDING", "Accuracy", "Settings"]

ROUNDING = 1e-12
"""Assumed relative error of a value that is exact up to rounding, whenever it is compared."""


class Settings(Protocol):
    """Accuracy, method and limits of a numerical solution."""

    @property
    def method(self) -> str:
        """'auto' or a name in METHODS."""
        ...

    @property
    def epsilon(self) -> float:
        """The requested width of the bounds."""
        ...

    @property
    def relative(self) -> bool:
        """Whether the width is relative to the value."""
        ...

    @property
    def certify(self) -> bool:
        """Whether the bounds must be proved."""
        ...

    @property
    def max_iterations(self) -> int:
        """The largest number of sweeps, products or policies."""
        ...

    @property
    def strategy(self) -> bool:
        """Whether the choices are asked for that attain the solution."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Settings for use without a check."""

    method: str = "auto"
    epsilon: float = 1e-6
    relative: bool = True
    certify: bool = True
    max_iterations: int = 1_000_000
    strategy: bool = False
