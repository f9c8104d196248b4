"""What building a model needs to be told; the options of a check fit this protocol."""

from __future__ import annotations

from typing import Protocol

__all__ = ["BuildSettings"]


class BuildSettings(Protocol):
    """Which faults of a model are errors, limits, and the order of the variables."""

    @property
    def fix_deadlocks(self) -> bool:
        """Whether a deadlock gets a self-loop; else it is an error."""
        ...

    @property
    def check_sums(self) -> bool:
        """Whether probabilities must sum to 1."""
        ...

    @property
    def max_memory(self) -> int | None:
        """Memory limit of the diagram manager, in bytes."""
        ...

    @property
    def time_limit(self) -> float | None:
        """Time limit in seconds."""
        ...

    @property
    def order(self) -> tuple[str, ...] | None:
        """Variables from the top of the diagrams down, or ('force',) or ('sift',): one that is looked for; None: as declared."""
        ...
